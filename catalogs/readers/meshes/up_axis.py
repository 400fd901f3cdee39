"""Axis of a mesh that points up, by the names of its faces or the floors of its buildings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catalogs.features import Remark
from catalogs.readers.meshes.surfaces import MeshSurface
from catalogs.readers.settings import MODELS
from facade_core.core.arrays import Float64Array

Z_UP_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_LEVEL_SEMANTICS = ("roof", "ground", "ceiling")
_UPRIGHT_SEMANTICS = ("wall", "window", "door")
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
    return [Remark(name, Z_UP_GLTF_REASON, None)] if _find_up(surfaces) == "y" else []


@np.errstate(invalid="ignore", over="ignore")  # broken vertices become faults later
def _find_up(surfaces: Sequence[MeshSurface]) -> str | None:
    """Return "y" or "z" as the names of faces, or else floors of closed models, show it; None where they show nothing."""
    filled = [one for one in surfaces if len(one.corners)]
    if not filled:
        return None
    corners = np.concatenate([one.corners for one in filled])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.linalg.norm(normals, axis=1)
    sound = np.isfinite(areas) & (areas > 0)
    if not sound.any():
        return None
    semantics = np.repeat([one.semantic for one in filled], [len(one.corners) for one in filled])[sound]
    level, upright = np.isin(semantics, _LEVEL_SEMANTICS), np.isin(semantics, _UPRIGHT_SEMANTICS)
    normals, areas = normals[sound], areas[sound]
    if not (level | upright).any():
        return _find_axis_of_floor(normals, areas)
    along = normals**2 / areas[:, None]
    fit = along[level].sum(axis=0) + (areas[upright, None] - along[upright]).sum(axis=0)
    return "y" if fit[1] > MODELS.min_up_axis_advantage * fit[2] else "z"


def _find_axis_of_floor(normals: Float64Array, areas: Float64Array) -> str | None:
    """Return the axis along which closed models have a level floor and no level roof of its size; None without one."""
    if np.abs(normals.sum(axis=0)).max() > MODELS.min_floor_share * areas.sum():
        return None  # open models
    directions = normals / areas[:, None]
    below, above = ((areas[:, None] * is_level).sum(axis=0) for is_level in (directions < -0.995, directions > 0.995))
    excess = np.abs(below - above) / areas.sum()
    for name, own, other in (("y", excess[1], excess[2]), ("z", excess[2], excess[1])):
        if own > MODELS.min_floor_share and other < MODELS.max_other_floor_share * own:
            return name
    return None
