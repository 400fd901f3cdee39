"""Surfaces of a CityGML building: parts and semantics, selection of the level of detail, polygons and rings."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from catalogs.readers.citygml.stream import gml_id, local_name, parse_numbers
from catalogs.readers.faces import SURFACE_SEMANTICS, have_equal_extents
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import GeometryError

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_BOUNDARY_TAGS = frozenset(("boundedBy", "boundary", "opening", "fillingSurface"))
_UNIT_KINDS = {
    "consistsOfBuildingPart": "part",
    "buildingPart": "part",
    "outerBuildingInstallation": "installation",
    "buildingInstallation": "installation",
}
_POLYGON_TAGS = frozenset(("Polygon", "PolygonPatch", "Triangle", "Rectangle"))
_RING_TAGS = ("{*}exterior", "{*}outerBoundaryIs", "{*}interior", "{*}innerBoundaryIs")
_LOD_TAG = re.compile(r"lod([0-4])(?:Solid|MultiSurface|Geometry|FootPrint|RoofEdge)")
_OTHER_GEOMETRY_TAG = re.compile(r"lod[0-4][A-Z]|pointCloud$")
_HREF = "{http://www.w3.org/1999/xlink}href"
_NAMESPACES = {
    "g": "http://www.opengis.net/gml",
    "h": "http://www.opengis.net/gml/3.2",
    "x": "http://www.w3.org/1999/xlink",
}


@dataclass(frozen=True, slots=True)
class CityGmlSurface:
    """Polygon of a building.

    Attributes
    ----------
    polygon : XML element.
    is_reversed : True where the polygon faces the other way.
    semantic : member of SEMANTICS, "inside" for surfaces to skip, or None.
    """

    polygon: Element
    is_reversed: bool
    semantic: str | None


@dataclass(frozen=True, slots=True)
class BuildingUnit:
    """Building, building part or outer installation, with its surfaces by level of detail."""

    kind: str
    surfaces_by_lod: dict[int, list[CityGmlSurface]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Geometry:
    """Geometry property of one level of detail; unit is the index of its owner."""

    member: Element
    unit: int
    lod: int
    semantic: str | None


def collect_building_units(building: Element) -> tuple[list[BuildingUnit], bool, list[str]]:
    """Return the units of a building, whether references lead out of it, and the geometries that are not read.

    The geometries that are not read are the names of their properties, such as lod3ImplicitRepresentation.

    Units are the building, its parts and outer installations. Each polygon is in one unit. Thematic surfaces precede
    the solids that refer to their polygons.
    """
    references = building.xpath(".//@x:href", namespaces=_NAMESPACES)
    ids = {gml_id(e): e for e in building.xpath(".//*[@g:id or @h:id]", namespaces=_NAMESPACES)} if references else {}
    kinds, geometries, passed_over = _collect_geometries(building, ids)
    units = [BuildingUnit(kind) for kind in kinds]
    semantics: dict[Element, str | None] = {}
    taken = set()
    # thematic surfaces before the solids that refer to their polygons
    for geometry in sorted(geometries, key=lambda found: found.semantic is None):
        for polygon, turned in _iterate_polygons(geometry.member, ids):
            if (geometry.lod, polygon) not in taken:
                taken.add((geometry.lod, polygon))
                semantic = semantics.setdefault(polygon, geometry.semantic)
                units[geometry.unit].surfaces_by_lod.setdefault(geometry.lod, []).append(
                    CityGmlSurface(polygon, turned, semantic)
                )
    dangling = any(name.startswith("#") and name[1:] not in ids for name in references)
    return units, dangling, passed_over


def _collect_geometries(building: Element, ids: Mapping[str, Element]) -> tuple[list[str], list[_Geometry], list[str]]:
    """Return the kind of each unit, that of the building first, all geometries outside rooms, and those not read."""
    kinds, geometries, visited = ["building"], [], set()
    passed_over: list[str] = []
    features: list[tuple[Element, int, str | None]] = [(building, 0, None)]
    for feature, unit, semantic in features:  # grows in the loop
        if feature.findtext("{*}relationToConstruction", "").strip() == "inside" or feature in visited:
            continue
        visited.add(feature)
        for member in feature.iterchildren("{*}*"):
            name = local_name(member)
            if match := _LOD_TAG.fullmatch(name):
                geometries.append(_Geometry(member, unit, int(match[1]), semantic))
            elif name in _BOUNDARY_TAGS:
                features += [
                    (s, unit, SURFACE_SEMANTICS.get(local_name(s), "unknown")) for s in _resolve_targets(member, ids)
                ]
            elif name in _UNIT_KINDS:
                for part in _resolve_targets(member, ids):
                    kinds.append(_UNIT_KINDS[name])
                    features.append((part, len(kinds) - 1, None))
            elif _OTHER_GEOMETRY_TAG.match(name):
                passed_over.append(name)
    return kinds, geometries, passed_over


def _resolve_targets(member: Element, ids: Mapping[str, Element]) -> list[Element]:
    """Return the children of a property, or the element of the building that it refers to."""
    target = ids.get(member.get(_HREF, "").removeprefix("#"))
    return [*member.iterchildren("{*}*")] if target is None else [target]


def _iterate_polygons(member: Element, ids: Mapping[str, Element]) -> Iterator[tuple[Element, bool]]:
    """Yield each polygon of a geometry once, and whether it is reversed; cavities of solids are skipped."""
    stack, visited = [(member, False)], set()
    while stack:
        element, turned = stack.pop()
        name = local_name(element)
        if name in _POLYGON_TAGS and element not in visited:
            yield element, turned
        elif name != "interior" and element not in visited:
            turned ^= name == "OrientableSurface" and element.get("orientation") == "-"
            stack += [(target, turned) for target in reversed(_resolve_targets(element, ids))]
        visited.add(element)


def select_lod_surfaces(units: Sequence[BuildingUnit], requested_lod: int | None) -> tuple[list[CityGmlSurface], int]:
    """Return the surfaces to read and their level of detail.

    Parts without the level use their nearest; installations use none above it. A solid of the building that is the hull of
    its parts is left out.

    Parameters
    ----------
    units : units of one building.
    requested_lod : 0 to 4, None for the highest.

    Raises
    ------
    GeometryError
        Where there is no level above 0.
    """
    lods = set().union(*(unit.surfaces_by_lod for unit in units if unit.kind != "installation"))
    if not lods:
        raise GeometryError("it has no geometry; add a LoD 1 to 3 model or delete it")
    if lods == {0}:
        raise GeometryError("it has a footprint only (LoD 0); export it at LoD 1 or above")
    chosen = _nearest_lod(lods, 4 if requested_lod is None else requested_lod)
    whole = chosen in units[0].surfaces_by_lod
    parts = [unit for unit in units if unit.kind == "part" and chosen in unit.surfaces_by_lod]
    if whole and parts and have_equal_extents(*(_surface_points(of, chosen) for of in (units[:1], parts))):
        units = units[1:]
    found = []
    for unit in units:
        lod = _nearest_lod(unit.surfaces_by_lod, chosen)
        # do not add the hull of a part to a whole building, nor the hull of the whole to its parts
        coarser = {"part": not whole, "installation": lod < chosen}.get(unit.kind, False)
        if lod == chosen or (lod and coarser):
            found += unit.surfaces_by_lod[lod]
    return found, chosen


def _surface_points(units: Sequence[BuildingUnit], lod: int) -> Float64Array:
    """Return the corners (n, 3) of the surfaces of units."""
    surfaces = chain.from_iterable(unit.surfaces_by_lod[lod] for unit in units)
    rings = [ring for surface in surfaces for ring in polygon_rings(surface.polygon).values()]
    return np.concatenate([np.zeros((0, 3)), *rings])


def _nearest_lod(lods: Collection[int], requested: int) -> int:
    """Return the requested level, else the nearest lower, else the nearest higher; 0 without any."""
    lower = [lod for lod in lods if 0 < lod <= requested]
    return max(lower) if lower else min((lod for lod in lods if lod > 0), default=0)


def polygon_rings(polygon: Element) -> dict[str, Float64Array]:
    """Return the rings (n, 3) by id without the closing point, the outer ring first.

    The result is empty without an outer ring.

    Raises
    ------
    GeometryError
        Where coordinates are not three finite numbers each.
    """
    rings: dict[str, Float64Array] = {}
    for number, boundary in enumerate(polygon.iterchildren(*_RING_TAGS)):
        ring = _ring_vertices(boundary)
        if len(ring) >= 3:
            rings[next((gml_id(e) for e in boundary), "") or f" {number}"] = ring
        elif number == 0:
            break
    return rings


def _ring_vertices(boundary: Element) -> Float64Array:
    positions = [parse_numbers(e.text) for e in boundary.iter("{*}posList", "{*}pos", "{*}coordinates")]
    values = np.array(list(chain.from_iterable(positions)))
    if not np.isfinite(values).all():
        raise GeometryError("its coordinates are not all finite numbers; repair or delete it")
    if len(values) % 3 or _coordinate_dimension(boundary) == 2:
        raise GeometryError("its coordinates are not all x, y and z; export it with heights")
    ring = values.reshape(-1, 3)
    return ring[:-1] if len(ring) > 1 and (ring[0] == ring[-1]).all() else ring


def _coordinate_dimension(boundary: Element) -> int:
    stated = boundary.xpath("(.//@srsDimension | ancestor::*/@srsDimension)[last()]")
    return int(stated[0]) if stated and stated[0].isdigit() else 3
