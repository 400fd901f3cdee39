"""Solids of vector files: MultiPolygons with walls, PolyhedralSurfaces, TINs and MultiPatches."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from catalogs.crs import EARTH_RADIUS_M
from catalogs.readers.faces import PlanarFace, newell_normal, triangulate_faces
from catalogs.readers.settings import VECTORS
from facade_core.core.arrays import Float64Array
from facade_core.core.types import BuildingShell

# Types of surfaces of ISO 13249-3 that GEOS does not read, and the equivalent type.
_EQUIVALENT_TYPES = {15: 6, 16: 6, 17: 3}
_NESTED_TYPES = frozenset((4, 5, 6, 7))


def build_solid(geometry: BaseGeometry, *, is_lonlat: bool) -> BuildingShell | None:
    """Return the shell of a geometry whose faces enclose a building; None for an outline.

    A solid has VECTORS.min_solid_walls upright faces over VECTORS.min_solid_height_m. The faces are turned outwards.

    Parameters
    ----------
    geometry : polygons with z.
    is_lonlat : True for degrees, False for metres.
    """
    polygons = list(_iterate_polygons(geometry))
    heights = shapely.get_coordinates(geometry, include_z=True)[:, 2]
    if (
        len(polygons) <= VECTORS.min_solid_walls
        or not np.isfinite(heights).all()
        or np.ptp(heights) < VECTORS.min_solid_height_m
    ):
        return None
    scale = _metres_per_unit(geometry) if is_lonlat else (1.0, 1.0)
    faces = [PlanarFace([_ring_vertices(ring) for ring in (part.exterior, *part.interiors)]) for part in polygons]
    normals = np.array([newell_normal(face.rings[0] * (*scale, 1.0)) for face in faces])
    areas = np.linalg.norm(normals, axis=1)
    walls = (areas > VECTORS.min_face_area_m2) & (np.abs(normals[:, 2]) <= VECTORS.max_solid_wall_slope * areas)
    if np.count_nonzero(walls) < VECTORS.min_solid_walls:
        return None
    shell = triangulate_faces(faces, scale)
    return None if shell is None else _turn_outwards(shell)


def is_open_walls(geometry: BaseGeometry) -> bool:
    """Return True for upright faces over VECTORS.min_solid_height_m without floor and roof, which cover no ground."""
    if not shapely.has_z(geometry):
        return False
    heights = shapely.get_coordinates(geometry, include_z=True)[:, 2]
    faces = [newell_normal(_ring_vertices(part.exterior)) for part in _iterate_polygons(geometry)]
    is_upright = [abs(normal[2]) <= VECTORS.max_solid_wall_slope * np.linalg.norm(normal) for normal in faces]
    return bool(faces) and all(is_upright) and bool(np.ptp(heights) >= VECTORS.min_solid_height_m)


def convert_surface_wkb(content: bytes) -> bytes | None:
    """Return the WKB of a PolyhedralSurface, TIN or Triangle as (Multi)Polygon; None where it is broken."""
    data = bytearray(content)
    try:
        end = _convert_geometry(data, 0, 0)
    except (struct.error, ValueError):
        return None
    return bytes(data) if end <= len(data) else None


def _count_dimensions(code: int) -> int:
    """Return the numbers per vertex of a type of geometry, with z and m as flags (EWKB) or in its thousands (ISO)."""
    thousands = (code & 0x1FFFFFFF) // 1000
    has_z = bool(code & 0x80000000) or thousands in (1, 3)
    has_m = bool(code & 0x40000000) or thousands in (2, 3)
    return 2 + has_z + has_m


def _convert_geometry(data: bytearray, start: int, depth: int) -> int:
    """Replace the types of a geometry and its parts in place; returns the offset behind it."""
    if depth > VECTORS.max_nesting_depth or start >= len(data):
        raise ValueError(start)
    order = "<" if data[start] else ">"
    code, count = struct.unpack_from(f"{order}II", data, start + 1)
    flags, plain = code & 0xE0000000, code & 0x1FFFFFFF
    kind = _EQUIVALENT_TYPES.get(plain % 1000, plain % 1000)
    struct.pack_into(f"{order}I", data, start + 1, flags | (plain // 1000 * 1000 + kind))
    place = start + 9
    if flags & 0x20000000:  # an SRID precedes the count
        (count,) = struct.unpack_from(f"{order}I", data, start + 9)
        place += 4
    if kind in _NESTED_TYPES:
        for _ in range(count):
            place = _convert_geometry(data, place, depth + 1)
        return place
    if kind != 3:
        raise ValueError(kind)
    for _ in range(count):
        (points,) = struct.unpack_from(f"{order}I", data, place)
        place += 4 + points * 8 * _count_dimensions(code)
        if place > len(data):
            raise ValueError(place)
    return place


def _iterate_polygons(geometry: BaseGeometry) -> chain[Polygon]:
    """Yield the polygons of a geometry, of collections too."""
    parts: Sequence[BaseGeometry] = getattr(geometry, "geoms", [geometry])
    return chain.from_iterable(
        [part] if part.geom_type == "Polygon" else _iterate_polygons(part) if hasattr(part, "geoms") else []
        for part in parts
        if not part.is_empty
    )


def _ring_vertices(ring: BaseGeometry) -> Float64Array:
    """Return the vertices (n, 3) of a ring without the closing point."""
    vertices: Float64Array = shapely.get_coordinates(ring, include_z=True)[:-1]
    return vertices


def _metres_per_unit(geometry: BaseGeometry) -> tuple[float, float]:
    """Return the metres per degree of longitude and of latitude at a geometry."""
    metres = EARTH_RADIUS_M * np.pi / 180.0
    south, north = geometry.bounds[1], geometry.bounds[3]
    return float(metres * max(np.cos(np.radians((south + north) / 2)), 1e-3)), float(metres)


def _turn_outwards(shell: BuildingShell) -> BuildingShell:
    """Return a shell whose triangles face outwards."""
    import trimesh

    mesh = trimesh.Trimesh(shell.vertices - shell.vertices.mean(axis=0), shell.triangles, process=False)
    if not mesh.is_winding_consistent:
        trimesh.repair.fix_winding(mesh)  # type: ignore[no-untyped-call]
    triangles = np.asarray(mesh.faces, np.int32)
    if mesh.volume < 0:
        triangles = triangles[:, ::-1]
    return replace(shell, triangles=np.ascontiguousarray(triangles))
