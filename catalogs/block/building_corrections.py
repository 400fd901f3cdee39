"""Corrections of buildings: application to a block, and matching by id and location."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.block.corrections import BUILDING_CORRECTION_KINDS, Correction, Corrections
from catalogs.crs import LONLAT, coordinate_transform
from catalogs.features import format_reason_notes
from catalogs.readers.vectors.colours import ROOF_MATERIAL_COLOURS, WALL_MATERIAL_COLOURS, Colour, parse_colour
from catalogs.readers.vectors.roofs import estimate_roof_height
from facade_core.core.types import Building, BuildingFinish, Roof

if TYPE_CHECKING:
    from pyproj import CRS

    from catalogs.block.reader import Block

# Distance from the location of a facade's correction to the facade's building.
MAX_FACADE_DISTANCE_M = 2.0
# The location of a building's correction is inside its outline, up to rounding: a neighbour may replace a demolished building.
MAX_BUILDING_DISTANCE_M = 0.1
# Height of a building part above its base.
MIN_WALL_HEIGHT_M = 2.0
_FLAT_ROOF = Roof("flat", 0.0)


def apply_corrections_to_block(block: Block, corrections: Corrections) -> Block:
    """Return the block with corrections applied to its buildings; its digest is stale.

    A part of a city has its surroundings corrected too, but keeps only the corrections of its own buildings.
    """
    if not corrections:
        return block
    matched = corrections.rename_targets(match_corrections_by_location(block.buildings, corrections, block.crs))
    buildings, notes = apply_corrections_to_buildings(block.buildings, matched, block.storey)
    part = block.part
    if part is not None:
        distant, _ = apply_corrections_to_buildings(part.distant_buildings, matched, block.storey)
        part, matched = (
            replace(part, distant_buildings=distant),
            select_corrections_for_buildings(matched, part.buildings, block.buildings, block.crs),
        )
    return replace(block, buildings=buildings, part=part, corrections=matched, notes=block.notes + notes)


def apply_corrections_to_buildings(
    buildings: Sequence[Building], corrections: Corrections, storey: float
) -> tuple[tuple[Building, ...], tuple[str, ...]]:
    """Apply corrections to buildings, and note buildings whose corrections do not apply.

    The height and roof of a model stay as given, a flat roof has no height, and no building ends below its base.
    Assumed heights of other buildings do not change.

    Parameters
    ----------
    storey : metres per storey where only levels are corrected.

    Returns
    -------
    Corrected buildings in the given order, and notes.
    """
    selected = corrections.select_kinds(BUILDING_CORRECTION_KINDS)
    corrected: list[Building] = []
    skipped: list[str] = []
    for building in buildings:
        if building.id in selected:
            building, is_complete = _correct_building(building, corrections, storey)
            skipped += [] if is_complete else [building.id]
        corrected.append(building)
    reason = "heights or roofs corrected of models, of roofs that are flat, or of what would end below where it begins"
    reason += ", which stay as given"
    return tuple(corrected), format_reason_notes({reason: skipped})


def _correct_building(building: Building, corrections: Corrections, storey: float) -> tuple[Building, bool]:
    """Return the corrected building, and whether every correction was applied."""
    building = replace(building, finish=_correct_finish(building, corrections))
    stated_height = corrections.value_correction(building.id, "height")
    levels = corrections.value_correction(building.id, "levels")
    shape = corrections.value_correction(building.id, "roof_shape")
    roof_height = corrections.value_correction(building.id, "roof_height")
    if levels is not None:
        building = replace(building, levels=int(levels))
    if building.shell is not None:
        return building, (stated_height, shape, roof_height) == (None, None, None)
    height, source = building.height, building.height_source
    if stated_height is not None:
        height, source = round(stated_height, 2), "height"
    elif levels is not None and source != "height":
        height, source = round(building.raised + int(levels) * storey, 2), "levels"
    is_complete = height >= building.raised + MIN_WALL_HEIGHT_M
    if is_complete:
        building = replace(building, height=height, height_source=source)
    roof = _correct_roof(building, shape, roof_height)
    if roof_height is not None and shape is None and roof == _FLAT_ROOF:
        is_complete = False  # the corrected height belonged to another shape
    return replace(building, roof=roof), is_complete


def _correct_roof(building: Building, shape: str | None, height: float | None) -> Roof | None:
    if shape is None and height is None:
        return building.roof
    before = building.roof or _FLAT_ROOF
    shape = shape or before.shape
    if shape == "flat":
        return _FLAT_ROOF
    is_same = before.shape == shape
    if height is None:
        if is_same:
            return replace(before, confidence=1.0)
        height = before.height if before.height > 0 else estimate_roof_height(building.footprint, shape)
    if is_same:
        return replace(before, height=round(height, 2), pitch=None, confidence=1.0)
    return Roof(shape, round(height, 2))


def _correct_finish(building: Building, corrections: Corrections) -> BuildingFinish:
    """Correct colours and materials; a colour implied by the old material is replaced with it."""
    before, id = building.finish, building.id
    wall_material, wall_colour = _correct_surface(
        (before.wall_material, before.wall_colour),
        corrections.value_correction(id, "wall_material"),
        corrections.value_correction(id, "wall_colour"),
        WALL_MATERIAL_COLOURS,
    )
    roof_material, roof_colour = _correct_surface(
        (before.roof_material, before.roof_colour),
        corrections.value_correction(id, "roof_material"),
        corrections.value_correction(id, "roof_colour"),
        ROOF_MATERIAL_COLOURS,
    )
    return replace(
        before,
        wall_material=wall_material,
        wall_colour=wall_colour,
        roof_material=roof_material,
        roof_colour=roof_colour,
    )


def _correct_surface(
    stated: tuple[str | None, Colour | None], material: str | None, colour: str | None, usual: Mapping[str, Colour]
) -> tuple[str | None, Colour | None]:
    """Return the material and colour of walls or roofs after corrections; `usual` is the colour by material."""
    old_material, old_colour = stated
    new_material = old_material if material is None else material
    if colour is not None:
        return new_material, parse_colour(colour)
    is_implied = new_material != old_material and old_colour == usual.get(old_material or "")
    return new_material, usual.get(new_material or "") if is_implied else old_colour


def match_corrections_by_location(
    buildings: Sequence[Building], corrections: Corrections, crs: CRS | str
) -> dict[str, str]:
    """Match corrected buildings whose id is gone to the building at their location.

    Returns
    -------
    Old id -> new id.
    """
    ids = {building.id for building in buildings}
    missing = {
        id: by_kind for id, by_kind in corrections.select_kinds(BUILDING_CORRECTION_KINDS).items() if id not in ids
    }
    located = [
        (id, correction) for id, by_kind in missing.items() if (correction := _located_correction(by_kind)) is not None
    ]
    if not located:
        return {}
    near = nearest_building_indices([correction for _, correction in located], buildings, crs)
    return {id: buildings[index].id for (id, _), index in zip(located, near, strict=True) if index >= 0}


def select_corrections_for_buildings(
    corrections: Corrections, core_ids: Sequence[str], buildings: Sequence[Building], crs: CRS | str
) -> Corrections:
    """Select the corrections of a city that belong to `core_ids` or to their facades.

    Parameters
    ----------
    core_ids : ids of the buildings to select for.
    buildings : these buildings and those around them.
    crs : frame of the buildings.
    """
    core = set(core_ids)
    owners = building_ids_by_correction(corrections, buildings, crs)
    selected = {id: by_kind for id, by_kind in corrections.by_target.items() if owners[id] in core}
    return Corrections(selected, {id: name for id, name in corrections.new_ids.items() if name in selected})


def building_ids_by_correction(
    corrections: Corrections, buildings: Sequence[Building], crs: CRS | str
) -> dict[str, str]:
    """Return corrected id -> id of the building that the correction belongs to, empty if none.

    The building with that id (or the facade's building) is taken if the correction's location is close to it,
    otherwise the nearest building to the location, otherwise the building with that id.
    """
    indices = {building.id: index for index, building in enumerate(buildings)}
    owner = {id: indices.get(id, indices.get(id.rpartition("-")[0], -1)) for id in corrections.by_target}
    places = {
        id: correction
        for id, by_kind in corrections.by_target.items()
        if (correction := _located_correction(by_kind)) is not None
    }
    footprints = np.array([building.footprint for building in buildings], dtype=object)
    distant = []
    for id, point in zip(places, _project_points(list(places.values()), crs), strict=True):
        index = owner[id]
        if index < 0 or not shapely.dwithin(footprints[index], point, MAX_FACADE_DISTANCE_M):
            distant.append(id)
    near = nearest_building_indices([places[id] for id in distant], buildings, crs)
    for id, index in zip(distant, near, strict=True):
        if index >= 0:
            owner[id] = index
    return {id: buildings[index].id if index >= 0 else "" for id, index in owner.items()}


def nearest_building_indices(places: Sequence[Correction], buildings: Sequence[Building], crs: CRS | str) -> list[int]:
    """Return for each correction the index of the building nearest to its location, the first of several, or -1.

    Parameters
    ----------
    places : corrections with a location.
    crs : frame of the buildings.

    Returns
    -------
    Indices of buildings; -1 beyond MAX_FACADE_DISTANCE_M, of a building's correction beyond MAX_BUILDING_DISTANCE_M.
    """
    found = [-1] * len(places)
    tree = shapely.STRtree([building.footprint for building in buildings])
    points = np.array(_project_points(places, crs), dtype=object)
    if len(points) and len(buildings):
        for number, index in sorted(
            zip(*tree.query_nearest(points, max_distance=MAX_FACADE_DISTANCE_M).tolist(), strict=True)
        ):
            reach = (
                MAX_BUILDING_DISTANCE_M if places[number].kind in BUILDING_CORRECTION_KINDS else MAX_FACADE_DISTANCE_M
            )
            if found[number] < 0 and shapely.dwithin(points[number], buildings[index].footprint, reach):
                found[number] = index
    return found


def _project_points(places: Sequence[Correction], crs: CRS | str) -> list[shapely.Point]:
    if not places:
        return []
    lonlat = np.array([one.place for one in places], float)
    points: list[shapely.Point] = shapely.points(np.column_stack(coordinate_transform(LONLAT, crs)(*lonlat.T))).tolist()
    return points


def _located_correction(by_kind: Mapping[str, Correction]) -> Correction | None:
    """Return the first correction that has a location."""
    return next((correction for correction in by_kind.values() if correction.place is not None), None)
