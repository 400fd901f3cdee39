"""Polygonal faces of a building model into its shell: triangulated in their own planes, columns instead of objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mapbox_earcut
import numpy as np

from facade_core.types import SEMANTICS, Shell


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A planar face: rings, the outer one first, each (n, 3) float64 without the closing point.

    semantic: one of SEMANTICS; texture: index of its picture, -1 without; uv: per ring (n, 2) texture coordinates, u right
    and v up, or None.
    """

    rings: Sequence[np.ndarray]
    semantic: str = "unknown"
    texture: int = -1
    uv: Sequence[np.ndarray] | None = None


def shell_of(faces: Sequence[Face], scale: tuple[float, float] = (1.0, 1.0)) -> Shell | None:
    """The shell of a building's faces; None where no face encloses an area.

    Equal vertices are shared. `scale` is the length of a unit of x and of y in metres, so that faces in degrees are cut in a
    plane of metres too.
    """
    corners, uvs, semantics, textures = [], [], [], []
    for face in faces:
        rings = [np.asarray(ring, np.float64) for ring in face.rings if len(ring) >= 3]
        if not rings:
            continue
        points = np.concatenate(rings)
        cut = _triangles(points * (*scale, 1.0), np.cumsum([len(ring) for ring in rings]))
        if len(cut) == 0:
            continue
        corners.append(points[cut])
        textured = face.texture >= 0 and face.uv is not None
        uv = (
            np.concatenate([u for u, r in zip(face.uv or (), face.rings, strict=False) if len(r) >= 3])
            if textured
            else None
        )
        uvs.append(np.zeros((len(cut), 3, 2)) if uv is None else uv[cut])
        semantics.append(np.full(len(cut), SEMANTICS.index(face.semantic)))
        textures.append(np.full(len(cut), face.texture if textured else -1))
    if not corners:
        return None
    vertices, index = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    return Shell(
        vertices=vertices,
        triangles=index.reshape(-1, 3).astype(np.int32),
        semantic=np.concatenate(semantics).astype(np.uint8),
        texture=np.concatenate(textures).astype(np.int32),
        uv=np.concatenate(uvs).astype(np.float32),
    )


def _triangles(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Corners (t, 3) of the triangles of a face, turning as its outer ring does; empty where it encloses no area."""
    outer = points[: ends[0]] - points[0]
    normal = np.cross(outer, np.roll(outer, -1, axis=0)).sum(axis=0)  # Newell: twice the area, along the normal
    length = np.linalg.norm(normal)
    if not length > 1e-6:
        return np.empty((0, 3), np.int64)
    normal /= length
    right = np.cross([0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0], normal)
    right /= np.linalg.norm(right)
    flat = (points - points[0]) @ np.column_stack([right, np.cross(normal, right)])
    cut = mapbox_earcut.triangulate_float64(flat, ends.astype(np.uint32)).astype(np.int64).reshape(-1, 3)
    a, b, c = (flat[cut[:, k]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    cut[turn < 0] = cut[turn < 0][:, ::-1]
    return cut[np.abs(turn) > 1e-9]
