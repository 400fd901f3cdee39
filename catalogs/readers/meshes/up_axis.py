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
Y_UP_REASON = "mesh files whose faces show that y is up, turned; state buildings.up where it is not"


def turn_up(surfaces: Sequence[MeshSurface], up: str | None, name: str) -> tuple[list[MeshSurface], list[Remark]]:
    """Return the surfaces with z up, and a remark where a file without a stated axis was turned.

    Parameters
    ----------
    surfaces : surfaces in the coordinates of the file.
    up : "y" or "z"; None to find it by the faces.
    name : name of the file.
    """
    is_y_up = up == "y" if up is not None else _is_y_up(surfaces)
    if not is_y_up:
        return list(surfaces), []
    turned = [replace(one, corners=one.corners @ Z_UP_FROM_Y_UP.T) for one in surfaces]
    return turned, [Remark(name, Y_UP_REASON, None)] if up is None else []


@np.errstate(invalid="ignore", over="ignore")  # broken vertices become faults later
def _is_y_up(surfaces: Sequence[MeshSurface]) -> bool:
    """Return True where the faces show that y is up; False where they show nothing."""
    filled = [one for one in surfaces if len(one.corners)]
    if not filled:
        return False
    corners = np.concatenate([one.corners for one in filled])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.linalg.norm(normals, axis=1)
    sound = np.isfinite(areas) & (areas > 0)
    if not sound.any():
        return False
    semantics = np.repeat([one.semantic for one in filled], [len(one.corners) for one in filled])[sound]
    normals, areas = normals[sound], areas[sound]
    along = (normals / areas[:, None]) ** 2
    level, upright = np.isin(semantics, _LEVEL_SEMANTICS), np.isin(semantics, _UPRIGHT_SEMANTICS)
    if level.any() or upright.any():
        fit = (areas[level, None] * along[level]).sum(axis=0) + (areas[upright, None] * (1 - along[upright])).sum(
            axis=0
        )
        return bool(fit[1] > _MIN_ADVANTAGE * fit[2])
    aligned = (areas[:, None] * ((along < 0.01) | (along > 0.99))).sum(axis=0) / areas.sum()
    if aligned[1] > _MIN_ALIGNED_SHARE and aligned[2] < _MAX_ALIGNED_SHARE:
        return True
    if aligned[2] > _MIN_ALIGNED_SHARE and aligned[1] < _MAX_ALIGNED_SHARE:
        return False
    if (shares := _open_shares(normals)) is not None:
        return bool(shares[1] > _MIN_OPEN_SHARE > 2 * abs(shares[2]))
    return _stands_along_y(filled)


def _open_shares(normals: Float64Array) -> Float64Array | None:
    """Return the share of the area along each axis that no opposite face balances; None for closed models."""
    sizes = np.abs(normals).sum(axis=0)
    if sizes.min() < _MIN_SIDE_SHARE * sizes.sum():  # faces along two axes only show nothing
        return None
    shares: Float64Array = normals.sum(axis=0) / sizes
    return shares if np.abs(shares[1:]).max() > _MIN_OPEN_SHARE else None


def _stands_along_y(surfaces: Sequence[MeshSurface]) -> bool:
    """Return True where named buildings have one lower end along y and different ones along z."""
    lows: dict[str, list[Float64Array]] = defaultdict(list)
    for one in surfaces:
        if one.building is not None:
            lows[one.building].append(one.corners.reshape(-1, 3).min(axis=0))
    if len(lows) < 2:
        return False
    lowest = np.array([np.min(one, axis=0) for one in lows.values()])
    spans = np.ptp(lowest, axis=0)
    is_height = bool((np.abs(lowest[:, 1]) < _MAX_HEIGHT_M).all())  # no northing
    return is_height and bool(spans[1] < _MAX_GROUND_SPAN_M and _MIN_SITE_SPAN_M < spans[2] < _MAX_SITE_SPAN_M)
