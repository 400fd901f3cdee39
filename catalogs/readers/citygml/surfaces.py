"""The surfaces of a CityGML building: its parts and their semantics, the level of detail to read, polygons and rings."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from catalogs.readers.citygml.stream import gml_id, local_name, parse_numbers
from catalogs.readers.faces import SURFACE_SEMANTICS
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
_HREF = "{http://www.w3.org/1999/xlink}href"
_NAMESPACES = {
    "g": "http://www.opengis.net/gml",
    "h": "http://www.opengis.net/gml/3.2",
    "x": "http://www.w3.org/1999/xlink",
}


@dataclass(frozen=True, slots=True)
class CityGmlSurface:
    """A polygon; turned: it faces the other way; semantic: one of SEMANTICS, "inside" for those not to be read, or None."""

    polygon: Element
    turned: bool
    semantic: str | None


@dataclass(frozen=True, slots=True)
class BuildingUnit:
    """The building, a part or an outer installation of it, with its surfaces by LoD."""

    kind: str
    surfaces: dict[int, list[CityGmlSurface]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Geometry:
    """A property that holds a geometry of one LoD; unit: the index of whose it is."""

    member: Element
    unit: int
    lod: int
    semantic: str | None


def collect_building_units(building: Element) -> tuple[list[BuildingUnit], bool]:
    """The building, its parts and outer installations, each polygon in one of them; whether a reference leads out of it."""
    references = building.xpath(".//@x:href", namespaces=_NAMESPACES)
    ids = {gml_id(e): e for e in building.xpath(".//*[@g:id or @h:id]", namespaces=_NAMESPACES)} if references else {}
    kinds, geometries = _collect_geometries(building, ids)
    units = [BuildingUnit(kind) for kind in kinds]
    semantics: dict[Element, str | None] = {}
    taken = set()
    # thematic surfaces before the solids that refer to their polygons
    for geometry in sorted(geometries, key=lambda found: found.semantic is None):
        for polygon, turned in _iterate_polygons(geometry.member, ids):
            if (geometry.lod, polygon) not in taken:
                taken.add((geometry.lod, polygon))
                semantic = semantics.setdefault(polygon, geometry.semantic)
                units[geometry.unit].surfaces.setdefault(geometry.lod, []).append(CityGmlSurface(polygon, turned, semantic))
    return units, any(name.startswith("#") and name[1:] not in ids for name in references)


def _collect_geometries(building: Element, ids: Mapping[str, Element]) -> tuple[list[str], list[_Geometry]]:
    """The kind of each unit, the building's own first, and every geometry outside of the building's rooms."""
    kinds, geometries, visited = ["building"], [], set()
    features: list[tuple[Element, int, str | None]] = [(building, 0, None)]
    for feature, unit, semantic in features:  # grows on the way
        inside = (feature.findtext("{*}relationToConstruction") or "").strip() == "inside"
        if inside or feature in visited:
            continue
        visited.add(feature)
        for member in feature.iterchildren("{*}*"):
            name = local_name(member)
            if match := _LOD_TAG.fullmatch(name):
                geometries.append(_Geometry(member, unit, int(match[1]), semantic))
            elif name in _BOUNDARY_TAGS:
                features += [(s, unit, SURFACE_SEMANTICS.get(local_name(s), "unknown")) for s in _resolve_targets(member, ids)]
            elif name in _UNIT_KINDS:
                for part in _resolve_targets(member, ids):
                    kinds.append(_UNIT_KINDS[name])
                    features.append((part, len(kinds) - 1, None))
    return kinds, geometries


def _resolve_targets(member: Element, ids: Mapping[str, Element]) -> list[Element]:
    """What a property holds, or what of its building it refers to."""
    target = ids.get(member.get(_HREF, "").removeprefix("#"))
    return [*member.iterchildren("{*}*")] if target is None else [target]


def _iterate_polygons(member: Element, ids: Mapping[str, Element]) -> Iterator[tuple[Element, bool]]:
    """Each polygon of a geometry once, and whether it is turned over; a solid's cavities are left out."""
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


def select_surfaces(units: Sequence[BuildingUnit], requested_lod: int | None) -> tuple[list[CityGmlSurface], int]:
    """The surfaces to read and their LoD: parts without it at their nearest, installations at none above it.

    asked: 0 to 4, None for the highest. Raises GeometryError where there is none above LoD 0.
    """
    lods = {lod for unit in units for lod in unit.surfaces if unit.kind != "installation"}
    if not lods:
        raise GeometryError("it has no geometry; add a LoD 1 to 3 model or delete it")
    if lods == {0}:
        raise GeometryError("it has a footprint only (LoD 0); export it at LoD 1 or above")
    chosen = _nearest_lod(lods, 4 if requested_lod is None else requested_lod)
    whole = chosen in units[0].surfaces
    found = []
    for unit in units:
        lod = _nearest_lod(unit.surfaces, chosen)
        # a part's hull must not be added to a building that is there as a whole, nor the whole's hull to its parts
        coarser = (unit.kind == "part" and not whole) or (unit.kind == "installation" and lod < chosen)
        if lod == chosen or (lod and coarser):
            found += unit.surfaces[lod]
    return found, chosen


def _nearest_lod(lods: Collection[int], requested: int) -> int:
    """The LoD asked for, else the nearest lower, else the nearest higher; 0 where there is none."""
    lower = [lod for lod in lods if 0 < lod <= requested]
    return max(lower) if lower else min((lod for lod in lods if lod > 0), default=0)


def polygon_rings(polygon: Element) -> dict[str, np.ndarray]:
    """Rings by id, the outer one first, (n, 3) as stated but for the closing point; none where it has no outer ring.

    Raises GeometryError where coordinates are not three finite numbers each.
    """
    rings: dict[str, np.ndarray] = {}
    for number, boundary in enumerate(polygon.iterchildren(*_RING_TAGS)):
        positions = [parse_numbers(e.text) for e in boundary.iter("{*}posList", "{*}pos", "{*}coordinates")]
        values = np.array([value for position in positions for value in position])
        if not np.isfinite(values).all():
            raise GeometryError("its coordinates are not all finite numbers; repair or delete it")
        if len(values) % 3 or _coordinate_dimension(boundary) == 2:
            raise GeometryError("its coordinates are not all x, y and z; export it with heights")
        ring = values.reshape(-1, 3)
        ring = ring[:-1] if len(ring) > 1 and (ring[0] == ring[-1]).all() else ring
        if len(ring) >= 3:
            rings[next((gml_id(e) for e in boundary), "") or f" {number}"] = ring
        elif number == 0:
            break
    return rings


def _coordinate_dimension(boundary: Element) -> int:
    stated = boundary.xpath("(.//@srsDimension | ancestor::*/@srsDimension)[last()]")
    return int(stated[0]) if stated and stated[0].isdigit() else 3
