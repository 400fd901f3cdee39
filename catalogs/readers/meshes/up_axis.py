"""Axis of a mesh that points up, by the names and directions of its faces."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catalogs.features import Remark
from catalogs.readers.meshes.surfaces import MeshSurface
from facade_core.core.arrays import Float64Array

Z_UP_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_LEVEL_SEMANTICS = ("roof", "ground", "ceiling")
_UPRIGHT_SEMANTICS = ("wall", "window", "door")
_MIN_ADVANTAGE = 1.25  # of one axis over the other
_MIN_ALIGNED_SHARE = 0.9  # area of upright and level faces along the right axis
_MAX_ALIGNED_SHARE = 0.6  # of the same along the other axis
_MIN_OPEN_SHARE = 0.5  # of the level area of a model without a floor that faces up
_MIN_SIDE_SHARE = 0.05  # of the area, along each axis of a building
_MAX_GROUND_SPAN_M = 5.0  # m; between the lower ends of buildings on one ground
_MIN_SITE_SPAN_M = 20.0  # m
_MAX_SITE_SPAN_M = 50_000.0  # m
_MAX_HEIGHT_M = 10_000.0  # m above the datum
_MAX_GROUND_ERROR_M = 0.05  # m; from zero, on which many programs put the ground
_MIN_NORTH_EXTENT_M = 0.5  # m
_MIN_FLOOR_SHARE = 0.05  # of the area: a floor without an equal roof above it
_MAX_SIDE_SHARE = 0.3  # of that share: along the other axis
Y_UP_REASON = "mesh files whose faces show that y is up, turned; state buildings.up where it is not"
Y_UP_STATED_REASON = "mesh files whose comments say that y is up, turned; state buildings.up where it is not"
UNKNOWN_UP_REASON = (
    "mesh files whose faces do not show which axis is up, z taken; state buildings.up: y where it is not"
)
Z_UP_GLTF_REASON = (
    "glTF files whose faces show that z is up, where the format says y: they lie on their sides; export them with y up"
)


def turn_up(
    surfaces: Sequence[MeshSurface], up: str | None, name: str, stated: str | None = None
) -> tuple[list[MeshSurface], list[Remark]]:
    """Return the surfaces with z up, and a remark where a file without a stated axis was turned, or may have to be.

    Parameters
    ----------
    surfaces : surfaces in the coordinates of the file.
    up : "y" or "z" by the block file; None where it states none.
    name : name of the file.
    stated : "y" or "z" by the comments of the file; None to find it by the faces.
    """
    found = up or stated or _find_up(surfaces)
    if found is None and any(len(one.corners) for one in surfaces):
        return list(surfaces), [Remark(name, UNKNOWN_UP_REASON, None)]
    if found != "y":
        return list(surfaces), []
    turned = [replace(one, corners=one.corners @ Z_UP_FROM_Y_UP.T) for one in surfaces]
    reason = Y_UP_STATED_REASON if stated else Y_UP_REASON
    return turned, [Remark(name, reason, None)] if up is None else []


def note_sideways_gltf(surfaces: Sequence[MeshSurface], name: str) -> list[Remark]:
    """Return a remark where the faces of a glTF, converted to z up, show that the file had z up already."""
    shown = _find_up_by_faces([one for one in surfaces if len(one.corners)], is_closed=True)
    return [Remark(name, Z_UP_GLTF_REASON, None)] if shown == "y" else []


def _find_up(surfaces: Sequence[MeshSurface]) -> str | None:
    """Return "y" or "z" as the faces and places of buildings show it; None where they show nothing."""
    filled = [one for one in surfaces if len(one.corners)]
    if (shown := _find_up_by_faces(filled)) is not None:
        return shown
    return "y" if filled and _stands_along_y(filled) else _find_up_by_ground(filled)


@np.errstate(invalid="ignore", over="ignore")  # broken vertices become faults later
def _find_up_by_faces(filled: Sequence[MeshSurface], *, is_closed: bool = False) -> str | None:
    """Return "y" or "z" as names and directions of faces show it; None where they show nothing.

    is_closed: True to go by names and floors alone, not by open and aligned sides.
    """
    if not filled:
        return None
    corners = np.concatenate([one.corners for one in filled])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.linalg.norm(normals, axis=1)
    sound = np.isfinite(areas) & (areas > 0)
    if not sound.any():
        return None
    semantics = np.repeat([one.semantic for one in filled], [len(one.corners) for one in filled])[sound]
    normals, areas = normals[sound], areas[sound]
    along = (normals / areas[:, None]) ** 2
    level, upright = np.isin(semantics, _LEVEL_SEMANTICS), np.isin(semantics, _UPRIGHT_SEMANTICS)
    if level.any() or upright.any():
        fit = (areas[level, None] * along[level]).sum(axis=0) + (areas[upright, None] * (1 - along[upright])).sum(
            axis=0
        )
        return "y" if fit[1] > _MIN_ADVANTAGE * fit[2] else "z"
    if (floor := _axis_of_floor(normals, areas)) is not None:
        return floor
    if is_closed:
        return None
    aligned = (areas[:, None] * ((along < 0.01) | (along > 0.99))).sum(axis=0) / areas.sum()
    if aligned[1] > _MIN_ALIGNED_SHARE and aligned[2] < _MAX_ALIGNED_SHARE:
        return "y"
    if aligned[2] > _MIN_ALIGNED_SHARE and aligned[1] < _MAX_ALIGNED_SHARE:
        return "z"
    if (shares := _open_shares(normals)) is not None:
        return "y" if shares[1] > _MIN_OPEN_SHARE > 2 * abs(shares[2]) else "z"
    return None


def _axis_of_floor(normals: Float64Array, areas: Float64Array) -> str | None:
    """Return the axis along which closed models have a level floor and no level roof of its size; None without one."""
    if np.abs(normals.sum(axis=0)).max() > _MIN_FLOOR_SHARE * areas.sum():
        return None  # open models
    directions = normals / areas[:, None]
    excess = (
        np.abs(
            (areas[:, None] * (directions < -0.995)).sum(axis=0) - (areas[:, None] * (directions > 0.995)).sum(axis=0)
        )
        / areas.sum()
    )
    for name, own, other in (("y", excess[1], excess[2]), ("z", excess[2], excess[1])):
        if own > _MIN_FLOOR_SHARE and other < _MAX_SIDE_SHARE * own:
            return name
    return None


def _find_up_by_ground(surfaces: Sequence[MeshSurface]) -> str | None:
    """Return the axis on whose zero all buildings stand, if one alone is; z where y are northings."""
    lowest = np.array([*_lowest_corners(surfaces).values()])
    if not len(lowest) or not np.isfinite(lowest).all():
        return None
    highest = np.max([one.corners.reshape(-1, 3).max(axis=0) for one in surfaces], axis=0)
    is_level = highest[1] - lowest[:, 1].min() < _MIN_NORTH_EXTENT_M  # without height if y were up
    if is_level or (np.abs(lowest[:, 1]) > _MAX_HEIGHT_M).all():
        return "z"
    on_y, on_z = (bool((np.abs(lowest[:, axis]) < _MAX_GROUND_ERROR_M).all()) for axis in (1, 2))
    if on_y == on_z:
        return None
    if on_z:
        return "z"
    return "y" if (lowest[:, 2] < -_MIN_NORTH_EXTENT_M).any() else None


def _lowest_corners(surfaces: Sequence[MeshSurface]) -> dict[str, Float64Array]:
    """Return the lowest coordinates (3,) of each named building, or of all surfaces where none has a name."""
    lows: dict[str, list[Float64Array]] = defaultdict(list)
    for one in surfaces:
        lows[one.building or ""].append(one.corners.reshape(-1, 3).min(axis=0))
    return {name: np.min(found, axis=0) for name, found in lows.items()}


def _open_shares(normals: Float64Array) -> Float64Array | None:
    """Return the share of the area along each axis that no opposite face balances; None for closed models."""
    sizes = np.abs(normals).sum(axis=0)
    if sizes.min() < _MIN_SIDE_SHARE * sizes.sum():  # faces along two axes only show nothing
        return None
    shares: Float64Array = normals.sum(axis=0) / sizes
    return shares if np.abs(shares[1:]).max() > _MIN_OPEN_SHARE else None


def _stands_along_y(surfaces: Sequence[MeshSurface]) -> bool:
    """Return True where named buildings have one lower end along y and different ones along z."""
    lowest_by_name = _lowest_corners([one for one in surfaces if one.building is not None])
    if len(lowest_by_name) < 2:
        return False
    lowest = np.array([*lowest_by_name.values()])
    spans = np.ptp(lowest, axis=0)
    is_height = bool((np.abs(lowest[:, 1]) < _MAX_HEIGHT_M).all())  # no northing
    return is_height and bool(spans[1] < _MAX_GROUND_SPAN_M and _MIN_SITE_SPAN_M < spans[2] < _MAX_SITE_SPAN_M)
