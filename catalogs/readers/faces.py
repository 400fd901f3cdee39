"""Triangulation of polygonal faces of a building model into a shell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import mapbox_earcut
import numpy as np

from catalogs.readers.settings import LIMITS
from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.errors import GeometryError
from facade_core.core.types import SEMANTICS, BuildingShell

# Semantics of the surface types of CityGML (2.0 and 3.0) and CityJSON; interior surfaces are skipped.
SURFACE_SEMANTICS = {
    "RoofSurface": "roof",
    "OuterFloorSurface": "roof",
    "WallSurface": "wall",
    "GroundSurface": "ground",
    "OuterCeilingSurface": "ceiling",
    "Window": "window",
    "WindowSurface": "window",
    "Door": "door",
    "DoorSurface": "door",
} | dict.fromkeys(("ClosureSurface", "InteriorWallSurface", "CeilingSurface", "FloorSurface"), "inside")


@dataclass(frozen=True, slots=True, eq=False)
class PlanarFace:
    """Planar polygonal face of a building, with semantic and texture.

    Attributes
    ----------
    rings : (n, 3) vertices of each ring without the closing point, the outer ring first.
    semantic : member of SEMANTICS.
    texture : index of the picture, -1 without.
    uv : (n, 2) texture coordinates of each ring, u right and v up, or None.
    colour : colour of its material, None without one.
    """

    rings: Sequence[Float64Array]
    semantic: str = "unknown"
    texture: int = -1
    uv: Sequence[Float64Array] | None = None
    colour: tuple[int, int, int] | None = None


def newell_normal(ring: Float64Array) -> Float64Array:
    """Return the normal of a ring (n, 3) without the closing point, as long as its area."""
    local = ring - ring[0]
    normal: Float64Array = np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0) / 2
    return normal


def triangulate_faces(
    faces: Sequence[PlanarFace], metres_per_unit: tuple[float, float] = (1.0, 1.0)
) -> BuildingShell | None:
    """Return the shell of the faces of a building; None where no face has an area.

    Equal vertices are shared. Faces with a vertex that is not finite, or beyond LIMITS.max_coordinate, are dropped.

    Parameters
    ----------
    faces : faces of one building.
    metres_per_unit : metres per unit of x and of y, so that faces in degrees are triangulated in a metric plane.

    Raises
    ------
    GeometryError
        For a face of more than LIMITS.max_corners.
    """
    faces = [face for face in faces if face.rings and len(face.rings[0]) >= 3]
    rings = [[np.asarray(ring, np.float64) for ring in face.rings if len(ring) >= 3] for face in faces]
    if not faces:
        return None
    counts = [sum(map(len, group)) for group in rings]
    most = max(counts)
    if most > LIMITS.max_corners:
        raise GeometryError(
            f"a face of it has {most} corners, more than {LIMITS.max_corners}; cut it up, or simplify it"
        )
    points = np.concatenate([*chain.from_iterable(rings)])
    cut, owner = _triangulate(points, [[len(ring) for ring in group] for group in rings], metres_per_unit)
    if len(cut) == 0:
        return None
    semantic = np.array([SEMANTICS.index(face.semantic) for face in faces], np.uint8)
    texture = np.array([-1 if face.uv is None else face.texture for face in faces], np.int32)
    uv = np.zeros((len(cut), 3, 2), np.float32)
    if (texture >= 0).any():
        uv = np.concatenate([_face_uv(face, count) for face, count in zip(faces, counts, strict=True)])[cut]
    vertices, index = np.unique(points[cut].reshape(-1, 3), axis=0, return_inverse=True)
    return BuildingShell(
        vertices=vertices,
        triangles=index.reshape(-1, 3).astype(np.int32),
        semantic=semantic[owner],
        texture=texture[owner],
        uv=uv.astype(np.float32),
    )


def _face_uv(face: PlanarFace, count: int) -> Float64Array:
    """Return texture coordinates (count, 2) of the rings of a face; zeros without a texture."""
    if face.texture < 0 or face.uv is None:
        return np.zeros((count, 2))
    return np.concatenate([uv for uv, ring in zip(face.uv, face.rings, strict=True) if len(ring) >= 3])


def _triangulate(
    points: Float64Array, lengths: Sequence[Sequence[int]], metres_per_unit: tuple[float, float]
) -> tuple[Int64Array, Int64Array]:
    """Return triangle corners (t, 3) as rows of `points`, and the face (t,) of each.

    Triangles have the orientation of the outer ring. A face without an area has no triangles. The normal of a face is by
    Newell's method.

    Parameters
    ----------
    points : (n, 3) vertices of all rings.
    lengths : number of vertices of each ring of each face.
    metres_per_unit : metres per unit of x and of y.
    """
    size = np.array([sum(group) for group in lengths])
    first = np.cumsum(size) - size
    owner = np.repeat(np.arange(len(lengths)), size)
    ring_size = np.array([length for group in lengths for length in group])
    ring = np.cumsum(ring_size) - ring_size
    following = np.arange(1, len(points) + 1)
    following[ring + ring_size - 1] = ring

    near = np.logical_and.reduceat((np.abs(points) < LIMITS.max_coordinate).all(axis=1), first)
    points = np.where(near[owner][:, None], points, 0.0)
    local = (points - points[first][owner]) * (*metres_per_unit, 1.0)
    areas = np.add.reduceat(np.cross(local, local[following]), ring)  # Newell: twice the area, along the normal
    normal = areas[np.isin(ring, first)]
    length = np.linalg.norm(normal, axis=1)
    sound = length > LIMITS.min_double_face_area_m2
    normal = np.where(sound[:, None], normal, (0.0, 0.0, 1.0)) / np.where(sound, length, 1.0)[:, None]
    x, y, z = normal.T
    flat_lying = np.abs(z) >= 0.9
    right = np.column_stack([np.where(flat_lying, 0.0, -y), np.where(flat_lying, -z, x), np.where(flat_lying, y, 0.0)])
    right /= np.linalg.norm(right, axis=1)[:, None]
    axes = np.stack([right, np.cross(normal, right)], axis=2)
    flat = np.einsum("ni,nik->nk", local, axes[owner])

    cuts = [
        mapbox_earcut.triangulate_float64(flat[start : start + count], np.cumsum(group).astype(np.uint32)) + start
        if count > 3
        else np.arange(start, start + 3)
        for start, count, group in zip(first[sound], size[sound], _chosen(lengths, sound), strict=True)
    ]
    cut = np.concatenate([*cuts, np.empty(0, np.int64)]).astype(np.int64).reshape(-1, 3)
    a, b, c = (flat[cut[:, k]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    cut[turn < 0] = cut[turn < 0][:, ::-1]
    cut = cut[np.abs(turn) > LIMITS.min_double_triangle_area_m2]
    return cut, owner[cut[:, 0]]


def _chosen(groups: Sequence[Sequence[int]], mask: BoolArray) -> list[Sequence[int]]:
    return [group for group, wanted in zip(groups, mask, strict=True) if wanted]


def have_equal_extents(one: Float64Array, other: Float64Array) -> bool:
    """Return True where points (n, 3) and (m, 3) span the same box, up to a hundredth: a solid is the hull of its parts."""
    if not len(one) or not len(other):
        return False
    boxes = [np.array([points.min(axis=0), points.max(axis=0)]) for points in (one, other)]
    return bool((np.abs(boxes[0] - boxes[1]) <= np.ptp(boxes[0], axis=0) / 100).all())
