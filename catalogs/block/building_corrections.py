"""A block as people corrected it: its buildings' heights, roofs and materials; which of a city's corrections are of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from catalogs.block.corrections import BUILDING_CORRECTION_KINDS, Correction, Corrections
from catalogs.crs import LONLAT, coordinate_transform
from catalogs.features import notes_by_reason
from catalogs.readers.vectors.colours import ROOF_MATERIAL_COLOURS, WALL_MATERIAL_COLOURS, parse_colour
from catalogs.readers.vectors.roofs import estimate_roof_height
from facade_core.core.types import Building, Finish, Roof

if TYPE_CHECKING:
    from pyproj import CRS

    from catalogs.block.reader import Block

# A facade that was corrected is of a building that is no farther off than this, metres; a building stands over its own place,
# give or take so much: next to what is gone there is another.
MAX_FACADE_DISTANCE_M, MAX_BUILDING_DISTANCE_M = 2.0, 0.1
# What stands on others is at least so high, metres.
MIN_WALL_HEIGHT_M = 2.0


def apply_corrections(block: Block, corrections: Corrections) -> Block:
    """A block with what people corrected of it; of a part of a city, in its surroundings too, but it keeps those of its own.

    It has no digest of that yet.
    """
    if not corrections:
        return block
    known = corrections.rename_targets(match_by_location(block.buildings, corrections, block.crs))
    buildings, left = correct_buildings(block.buildings, known, block.storey)
    part = block.part
    if part is not None:
        beyond, _ = correct_buildings(part.distant_buildings, known, block.storey)
        part, known = replace(part, beyond=beyond), select_corrections(known, part.buildings, block.buildings, block.crs)
    return replace(block, buildings=buildings, part=part, corrections=known, notes=block.notes + left)


def correct_buildings(
    buildings: Sequence[Building], corrections: Corrections, storey: float
) -> tuple[tuple[Building, ...], tuple[str, ...]]:
    """Buildings as they were corrected, and a note of those that cannot be: a model's height and roof are as given, a flat roof
    has no height, and nothing ends below where it begins. No other building changes: assumed heights stay what they were."""
    said = corrections.select_kinds(BUILDING_CORRECTION_KINDS)
    found, left = [], []
    for building in buildings:
        if building.id in said:
            values = {what: one.value for what, one in said[building.id].items()}
            building, whole = _correct_building(building, values, storey)
            left += [] if whole else [building.id]
        found.append(building)
    reason = "heights or roofs corrected of models, of roofs that are flat, or of what would end below where it begins"
    reason += ", which stay as given"
    return tuple(found), notes_by_reason({reason: left})


def _correct_building(building: Building, said: Mapping[str, Any], storey: float) -> tuple[Building, bool]:
    """A building as it was corrected, and whether all of that could be."""
    building = replace(building, finish=_correct_finish(building.finish, said))
    if "levels" in said:
        building = replace(building, levels=int(said["levels"]))
    if building.shell is not None:
        return building, said.keys().isdisjoint(("height", "roof_shape", "roof_height"))
    height, source = building.height, building.height_source
    if "height" in said:
        height, source = round(said["height"], 2), "height"
    elif "levels" in said and source != "height":
        height, source = round(building.raised + building.levels * storey, 2), "levels"  # type: ignore[operator]
    whole = height >= building.raised + MIN_WALL_HEIGHT_M
    if whole:
        building = replace(building, height=height, height_source=source)
    roof = _correct_roof(building, said)
    if "roof_height" in said and "roof_shape" not in said and (roof is None or roof.shape == "flat"):
        whole = False  # the shape that it was of is withdrawn, or was the map's and is another now
    return replace(building, roof=roof), whole


def _correct_roof(building: Building, said: Mapping[str, Any]) -> Roof | None:
    before, shape, height = building.roof, said.get("roof_shape"), said.get("roof_height")
    if shape is None and height is None:
        return before
    shape = shape or (before.shape if before else "flat")
    if shape == "flat":
        return Roof("flat", 0.0)
    kept = before is not None and before.shape == shape
    if height is None:
        if kept:
            return replace(before, confidence=1.0)  # type: ignore[type-var]
        rise = before.height if before is not None else 0.0
        height = rise if rise > 0 else estimate_roof_height(building.footprint, shape)
    if kept:
        return replace(before, height=round(height, 2), pitch=None, confidence=1.0)  # type: ignore[type-var]
    return Roof(shape, round(height, 2))


def _correct_finish(finish: Finish, said: Mapping[str, Any]) -> Finish:
    """A colour that a material came with goes with it."""
    for part, usual in (("wall", WALL_MATERIAL_COLOURS), ("roof", ROOF_MATERIAL_COLOURS)):
        before, colour = getattr(finish, f"{part}_material"), getattr(finish, f"{part}_colour")
        material = said.get(f"{part}_material", before)
        if material != before and colour == usual.get(before or ""):
            colour = usual.get(material)
        if f"{part}_colour" in said:
            colour = parse_colour(said[f"{part}_colour"])
        finish = replace(finish, **{f"{part}_material": material, f"{part}_colour": colour})
    return finish


def match_by_location(buildings: Sequence[Building], corrections: Corrections, crs: CRS | str) -> dict[str, str]:
    """Of corrected buildings that have another id now, that one: the building that stands where they were corrected."""
    ids = {building.id for building in buildings}
    lost = {id: said for id, said in corrections.select_kinds(BUILDING_CORRECTION_KINDS).items() if id not in ids}
    placed = [(id, one) for id, said in lost.items() if (one := _located_correction(said)) is not None]
    if not placed:
        return {}
    near = nearest_buildings([one for _, one in placed], buildings, crs)
    return {id: buildings[at].id for (id, _), at in zip(placed, near, strict=True) if at >= 0}


def select_corrections(
    corrections: Corrections, core_ids: Sequence[str], buildings: Sequence[Building], crs: CRS | str
) -> Corrections:
    """Those of a city's corrections that are of some `own` buildings, or of facades of these, by ids; buildings: these and what
    stands around them."""
    mine = set(core_ids)
    owners = correction_owners(corrections, buildings, crs)
    of = {id: said for id, said in corrections.by_target.items() if owners[id] in mine}
    return Corrections(of, {id: name for id, name in corrections.new_ids.items() if name in of})


def correction_owners(corrections: Corrections, buildings: Sequence[Building], crs: CRS | str) -> dict[str, str]:
    """The building that each correction's id is of, empty where none is: the one of that id, or of the facade's, where it
    stands there; else the nearest one to where it was made, as `nearest_buildings` has it, else again the one of that id."""
    at = {building.id: index for index, building in enumerate(buildings)}
    named = {id: at.get(id, at.get(id.rpartition("-")[0], -1)) for id in corrections.by_target}
    places = {id: one for id, said in corrections.by_target.items() if (one := _located_correction(said)) is not None}
    footprints = np.array([building.footprint for building in buildings], dtype=object)
    away = []
    for id, point in zip(places, _project_points(list(places.values()), crs), strict=True):
        index = named[id]
        if index < 0 or not shapely.dwithin(footprints[index], point, MAX_FACADE_DISTANCE_M):
            away.append(id)
    near = nearest_buildings([places[id] for id in away], buildings, crs)
    for id, index in zip(away, near, strict=True):
        if index >= 0:
            named[id] = index
    return {id: buildings[index].id if index >= 0 else "" for id, index in named.items()}


def nearest_buildings(places: Sequence[Correction], buildings: Sequence[Building], crs: CRS | str) -> list[int]:
    """The building nearest to where each of some corrections was made, of several the first; -1 where that is farther off than
    PLACE_M, of a building than INSIDE_M."""
    found = [-1] * len(places)
    tree = shapely.STRtree([building.footprint for building in buildings])
    points = np.array(_project_points(places, crs), dtype=object)
    if len(points) and len(buildings):
        for number, index in sorted(zip(*tree.query_nearest(points, max_distance=MAX_FACADE_DISTANCE_M).tolist(), strict=True)):
            reach = MAX_BUILDING_DISTANCE_M if places[number].what in BUILDING_CORRECTION_KINDS else MAX_FACADE_DISTANCE_M
            if found[number] < 0 and shapely.dwithin(points[number], buildings[index].footprint, reach):
                found[number] = index
    return found


def _project_points(places: Sequence[Correction], crs: CRS | str) -> list[Any]:
    if not places:
        return []
    lonlat = np.array([one.place for one in places], float)
    return shapely.points(np.column_stack(coordinate_transform(LONLAT, crs)(*lonlat.T))).tolist()


def _located_correction(said: Mapping[str, Correction]) -> Correction | None:
    """One of the corrections of a thing that tells where it is."""
    return next((one for one in said.values() if one.place is not None), None)
