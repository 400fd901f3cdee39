"""CityObjects and geometries of a building: parts, installations and level of detail."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence

from catalogs.readers.cityjson.surfaces import NESTING_DEPTHS
from catalogs.readers.cityjson.values import list_or_empty
from facade_core.core.errors import GeometryError
from facade_core.core.json_types import JsonObject

BUILDING_TYPES = ("Building", "BuildingPart")
_LOD_TEXT = re.compile(r"(\d)(?:\.(\d+))?")

Lod = tuple[int, ...]  # (2,) or (2, 2); () without one
CityObjects = Mapping[str, JsonObject]


def parse_lod(text: object) -> Lod:
    """Return (2,) for 2 and "2", (2, 2) for 2.2 and "2.2", () for anything else."""
    found = _LOD_TEXT.fullmatch(str(text).strip())
    return tuple(int(digits) for digits in found.groups() if digits is not None) if found else ()


def format_lod(lod: Lod) -> str:
    """Return a level of detail as text, such as "2.2"."""
    return ".".join(map(str, lod)) or "unknown"


def is_of_building(thing: JsonObject) -> bool:
    """Return whether a CityObject is a building, or a part, room, element or installation of one."""
    return str(thing.get("type")).startswith("Building")


def group_building_objects(objects: CityObjects) -> Iterator[tuple[str, list[str]]]:
    """Yield (id, ids of its objects, itself first) of each building.

    A part without a building in the file counts as a building.
    """
    kin = {id for id, thing in objects.items() if is_of_building(thing)}
    parents: dict[str, str] = {}
    for id in objects:
        if id in kin:
            links = [(child, id) for child in _object_ids(objects[id], "children")]
            links += [(id, parent) for parent in _object_ids(objects[id], "parents")[:1]]
            for child, parent in links:
                if child in kin and parent in kin:
                    parents.setdefault(child, parent)
    roots: dict[str, str] = {}
    members: dict[str, list[str]] = defaultdict(list)
    for id in objects:
        line: dict[str, None] = {}  # the objects between this one and its root, or one whose root is known
        root = id
        while root in parents and root not in roots and root not in line:
            line[root] = None
            root = parents[root]
        if root in line:  # a cycle is cut at the object that closes it
            del parents[root]
        root = roots.get(root, root)
        roots.update(dict.fromkeys(line, root))
        members[root].append(id)
    for root, ids in members.items():
        if objects[root].get("type") in BUILDING_TYPES:
            yield root, [root, *(id for id in ids if id != root)]


def select_lod_geometries(
    ids: Sequence[str], objects: CityObjects, templates: Sequence[object], requested_lod: Lod | None
) -> tuple[list[tuple[str, list[JsonObject]]], Lod | None]:
    """Return the geometries of a building by the id of its objects, and a level that differs.

    The second value is the first level of detail other than the requested one, or None. All geometries have the
    requested level, else the nearest lower one, else the nearest higher.

    Parameters
    ----------
    ids : ids of the objects of the building, itself first.
    objects : CityObjects of the file.
    templates : geometry templates of the file.
    requested_lod : None for the highest.

    Raises
    ------
    GeometryError
        Where there are no surfaces.
    """
    levels = {id: _geometries_by_lod(objects[id], templates) for id in ids}
    filled = {kind: [id for id in ids if levels[id] and objects[id]["type"] in kind] for kind in _TYPE_GROUPS}
    body, elements, extras = filled.values()
    if not body:  # a building may consist of constructive elements
        body, extras = (elements, extras) if elements else (extras, [])
    solid = _solid_levels({lod for id in body for lod in levels[id]})
    chosen = _nearest_lod(solid, max(solid) if requested_lod is None else requested_lod)
    used = _body_levels(body, levels, ids[0], chosen)
    pieces = [(id, levels[id][lod]) for id, lod in used.items()]
    for id in extras:
        fit = [lod for lod in levels[id] if requested_lod is None or lod[:1] <= chosen[:1]]
        pieces += [(id, levels[id][max(fit)])] if fit else []
    others = [lod for lod in used.values() if requested_lod is not None and lod[: len(requested_lod)] != requested_lod]
    return pieces, next(iter(others), None)


_TYPE_GROUPS = (BUILDING_TYPES, ("BuildingConstructiveElement",), ("BuildingInstallation",))


def _solid_levels(found: Collection[Lod]) -> set[Lod]:
    """Return the levels of detail above 0; GeometryError without one."""
    solid = {lod for lod in found if lod[:1] != (0,)}
    if not found:
        raise GeometryError("it has no surfaces; give it a geometry, or remove it")
    if not solid:
        raise GeometryError(
            "it has only a footprint (LoD 0); give a model of LoD 1 or higher, or footprints with heights"
        )
    return solid


def _body_levels(
    body: Sequence[str], levels: Mapping[str, Mapping[Lod, list[JsonObject]]], root: str, chosen: Lod
) -> dict[str, Lod]:
    """Return the level of each object of a building; without those that the geometry of the others includes."""
    used = {}
    for id in body:
        own = {lod for lod in levels[id] if lod[:1] != (0,)}
        if chosen in own:
            used[id] = chosen
        elif own and id != root and chosen not in levels[root]:
            used[id] = _nearest_lod(own, chosen)
    return used


def _nearest_lod(lods: Collection[Lod], requested: Lod) -> Lod:
    same = [lod for lod in lods if lod[: len(requested)] == requested]
    lower = [lod for lod in lods if lod < requested]
    return max(same or lower or [min(lods)])


def _instantiated_shape(geometry: JsonObject, templates: Sequence[object]) -> JsonObject:
    """Return a geometry, or the template of which it is an instance."""
    if geometry.get("type") != "GeometryInstance":
        return geometry
    number = geometry.get("template")
    template = templates[number] if type(number) is int and 0 <= number < len(templates) else None
    if not isinstance(template, dict):
        raise GeometryError(f"it is an instance of template {number}, which is missing; export it anew")
    return template


def _geometries_by_lod(thing: JsonObject, templates: Sequence[object]) -> dict[Lod, list[JsonObject]]:
    """Return the geometries with surfaces by level of detail."""
    geometries = thing.get("geometry") or []
    if not isinstance(geometries, list) or not all(isinstance(geometry, dict) for geometry in geometries):
        raise GeometryError("its geometry is not a list of geometries; export it anew")
    levels = defaultdict(list)
    for geometry in geometries:
        shape = _instantiated_shape(geometry, templates)
        if str(shape.get("type")) in NESTING_DEPTHS and shape.get("boundaries"):
            levels[parse_lod(shape.get("lod"))].append(geometry)
    return dict(levels)


def _object_ids(thing: JsonObject, key: str) -> list[str]:
    return [id for id in list_or_empty(thing.get(key)) if isinstance(id, str)]
