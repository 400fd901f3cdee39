"""Faces of CityJSON geometries with semantics and textures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeGuard

import numpy as np

from catalogs.readers.cityjson.values import far_coordinates_to_nan, list_or_empty, mapping_or_empty, parse_points
from catalogs.readers.faces import SURFACE_SEMANTICS, PlanarFace
from catalogs.readers.settings import LIMITS
from catalogs.readers.vectors.colours import Colour
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import GeometryError
from facade_core.core.json_types import JsonObject

# Levels of nesting between a geometry and its surfaces.
NESTING_DEPTHS = {"MultiSurface": 0, "CompositeSurface": 0, "Solid": 1, "MultiSolid": 2, "CompositeSolid": 2}


@dataclass(frozen=True, slots=True, eq=False)
class CityJsonAppearance:
    """Textures and materials of a file.

    Attributes
    ----------
    uv : (m, 2) texture vertices.
    pictures : index of the picture of each texture, -1 where it is missing.
    theme : default theme of textures, or None.
    colours : colour of each material, None where it states none.
    material_theme : default theme of materials, or None.
    """

    uv: Float64Array
    pictures: Sequence[int]
    theme: str | None
    colours: Sequence[Colour | None] = ()
    material_theme: str | None = None


def extract_faces(geometry: JsonObject, points: Float64Array, appearance: CityJsonAppearance) -> list[PlanarFace]:
    """Return the faces of the outer shells of a geometry.

    Parameters
    ----------
    geometry : CityJSON geometry.
    points : (n, 3) vertices that the boundaries index.
    appearance : textures of the file.

    Raises
    ------
    GeometryError
        Where a boundary is no ring of vertices, or a vertex is missing or not finite.
    """
    depth = NESTING_DEPTHS[geometry["type"]]
    semantics = mapping_or_empty(geometry.get("semantics"))
    classes = _surface_semantics(semantics.get("surfaces"))
    materials = _select_theme(geometry, "material", appearance.material_theme)
    common = materials.get("value")
    parts = list(
        zip(
            _outer_surfaces(geometry["boundaries"], depth),
            _align_values(geometry["boundaries"], semantics.get("values"), depth),
            _align_values(
                geometry["boundaries"], _select_theme(geometry, "texture", appearance.theme).get("values"), depth
            ),
            _align_values(geometry["boundaries"], materials.get("values"), depth),
            strict=True,
        )
    )
    corners = _ring_vertices([ring for surface, *_ in parts for ring in surface], points)
    faces, first = [], 0
    for surface, kind, pictured, material in parts:
        rings = []
        for ring in surface:
            rings.append(corners[first : first + len(ring)])
            first += len(ring)
        semantic = classes[kind] if _is_index(kind, len(classes)) else "unknown"
        if semantic != "inside":
            texture, uv = _surface_texture(surface, pictured, appearance)
            number = material if material is not None else common
            colour = appearance.colours[number] if _is_index(number, len(appearance.colours)) else None
            faces.append(PlanarFace(rings, semantic, texture, uv, colour))
    return faces


def instantiate_geometry_template(geometry: JsonObject, template: Float64Array, corners: Float64Array) -> Float64Array:
    """Return the vertices (n, 3) of a template at the place of an instance.

    Parameters
    ----------
    geometry : GeometryInstance.
    template : (n, 3) vertices of the template.
    corners : (m, 3) vertices of the file.

    Raises
    ------
    GeometryError
        Where the instance has no place.
    """
    try:
        matrix = parse_points([geometry.get("transformationMatrix")], 16).reshape(4, 4)
        (anchor,) = geometry["boundaries"]
        if np.isnan(matrix).any() or type(anchor) is not int or not 0 <= anchor < len(corners):
            raise ValueError(anchor)
    except (TypeError, ValueError, KeyError) as error:
        raise GeometryError("an instance in it has no place or no matrix of 16 numbers; export it anew") from error
    with np.errstate(over="ignore", invalid="ignore"):
        return far_coordinates_to_nan(template @ matrix[:3, :3].T + matrix[:3, 3] + corners[anchor])


def _outer_surfaces(boundaries: object, depth: int) -> Iterator[list[list[int]]]:
    """Yield the surfaces of outer shells; further shells of a solid are voids."""
    if not isinstance(boundaries, list):
        raise GeometryError("its boundaries are no lists; export it anew")
    if depth == 0:
        for surface in boundaries:
            if not isinstance(surface, list) or not all(isinstance(ring, list) for ring in surface):
                raise GeometryError("its boundaries are not nested as their type asks; mend it with a validator")
            yield surface
    else:
        for part in boundaries[:1] if depth == 1 else boundaries:
            yield from _outer_surfaces(part, depth - 1)


def _align_values(boundaries: object, values: object, depth: int) -> Iterator[object]:
    """Yield the value of each surface of `_outer_surfaces` in its order, None without one."""
    parts, stated = list_or_empty(boundaries), list_or_empty(values)
    for index, part in enumerate(parts[:1] if depth == 1 else parts):
        value = stated[index] if index < len(stated) else None
        if depth == 0:
            yield value
        else:
            yield from _align_values(part, value, depth - 1)


def _ring_vertices(rings: Sequence[list[int]], points: Float64Array) -> Float64Array:
    """Return the concatenated vertices of all rings."""
    try:
        index = np.array(list(chain.from_iterable(rings)))
    except ValueError:
        index = np.empty((0, 0))
    if index.size == 0 and index.ndim == 1:
        return np.empty((0, 3))
    if index.ndim != 1 or index.dtype.kind not in "iu":
        raise GeometryError("a ring of it is no list of vertex numbers; mend it with a validator")
    if index.min() < 0 or index.max() >= len(points):
        wrong = index.min() if index.min() < 0 else index.max()
        raise GeometryError(f"it uses vertex {wrong} of a list of {len(points)}; export it anew")
    corners: Float64Array = points[index]
    if not np.isfinite(corners).all():
        wrong = index[~np.isfinite(corners).all(axis=1)][0]
        raise GeometryError(f"its vertex {wrong} is not three finite numbers; mend or remove it")
    return corners


def _surface_semantics(surfaces: object) -> list[str]:
    kinds = [mapping_or_empty(surface).get("type") for surface in list_or_empty(surfaces)]
    return [SURFACE_SEMANTICS.get(kind, "unknown") if isinstance(kind, str) else "unknown" for kind in kinds]


def _select_theme(geometry: JsonObject, kind: str, theme: str | None) -> JsonObject:
    """Return the default theme of textures or materials of a geometry, else its first by name; empty without one."""
    themes = mapping_or_empty(geometry.get(kind))
    if not themes:
        return {}
    return mapping_or_empty(themes[theme] if theme is not None and theme in themes else themes[min(themes)])


def _surface_texture(
    surface: list[list[int]], pictured: object, appearance: CityJsonAppearance
) -> tuple[int, list[Float64Array] | None]:
    """Return the picture of a surface and the coordinates of each ring; -1 and None where they do not fit."""
    if not isinstance(pictured, list) or len(pictured) < len(surface) or not surface:
        return -1, None
    number = next(iter(list_or_empty(pictured[0])), None)
    picture = appearance.pictures[number] if _is_index(number, len(appearance.pictures)) else -1
    uv = []
    for ring, values in zip(surface, pictured, strict=False):
        placed = _ring_coordinates(list_or_empty(values)[1:], appearance.uv)
        if picture < 0 or len(placed) != len(ring) or not (np.abs(placed) < LIMITS.max_coordinate).all():
            return -1, None
        uv.append(placed)
    return picture, uv


def _ring_coordinates(numbers: list[object], uv: Float64Array) -> Float64Array:
    """Return the coordinates (n, 2) by their numbers; none where one is no number of them."""
    known = [number for number in numbers if _is_index(number, len(uv))]
    return uv[known if len(known) == len(numbers) else []].reshape(-1, 2)


def _is_index(value: object, length: int) -> TypeGuard[int]:
    return type(value) is int and 0 <= value < length
