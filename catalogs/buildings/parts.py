"""Building parts of OpenStreetMap's "Simple 3D Buildings" scheme, which replace the outline that they cover."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from catalogs.buildings.roofs import add_assumed_roof
from catalogs.buildings.settings import PARTS, ROOFS
from catalogs.features import Footprint
from facade_core.core.types import Building, BuildingFinish, Roof


@dataclass(frozen=True)
class PartCandidate:
    """Building part, or a building that starts above the ground.

    Attributes
    ----------
    building : outline and id.
    footprint : footprint of the source.
    whole_id : id of the building that contains the part; None without one.
    """

    building: Building
    footprint: Footprint
    whole_id: str | None


def host_outline_indices(outlines: Sequence[Polygon], is_part: Sequence[bool]) -> list[int]:
    """Return for each outline the index of the outline of which it is a part, -1 for none.

    Only parts have a host: an outline of a whole building, else a larger part.

    Parameters
    ----------
    outlines : n polygons.
    is_part : (n,) flags.
    """
    found = np.full(len(outlines), -1)
    area = shapely.area(np.asarray(outlines, object))
    parts = np.flatnonzero(is_part)
    whole = np.flatnonzero(~np.asarray(is_part, bool))
    for among in (whole, parts):
        left = parts[found[parts] < 0]
        tree = shapely.STRtree([outlines[i] for i in among.tolist()])
        for one in left.tolist():
            near = among[tree.query(outlines[one], predicate="intersects")]
            near = near[(near != one) & (~np.isin(near, parts) | (found[near] < 0) & (area[near] > area[one]))]
            shared = [outlines[one].intersection(outlines[other]).area for other in near.tolist()]
            if shared and max(shared) > PARTS.min_host_share * area[one]:
                found[one] = near[int(np.argmax(shared))]
    for one in np.flatnonzero(found >= 0).tolist():  # a part may be hosted by a part
        while found[found[one]] >= 0:
            found[one] = found[found[one]]
    return found.tolist()


def split_buildings_into_parts(
    wholes: Sequence[Building],
    parts: Sequence[PartCandidate],
    floor_height: float,
    min_area: float,
    reasons: dict[str, list[str]],
) -> list[Building]:
    """Split buildings into their parts.

    A part without a height is as high as its building, and takes colours and materials of the building where it states
    none. Parts replace the covered area of the outline; the rest stays as the building, without pieces under `min_area`. The
    building stays below a raised part where it ends below that part, or where the part is in its interior.

    Parameters
    ----------
    wholes : buildings of known height; those without parts stay unchanged.
    parts : parts and raised buildings.
    floor_height : metres.
    min_area : m2.
    reasons : receives the ids of dropped parts by reason.
    """
    own: dict[str, list[PartCandidate]] = defaultdict(list)
    every = list(wholes)
    for part in parts:
        if part.whole_id is None:
            every += _extrude_part(part, None, floor_height, reasons)
        else:
            own[part.whole_id].append(part)
    found = []
    for whole in every:
        mine = own.pop(whole.id, [])
        known = {one.building.id: one.footprint for one in mine}
        raised = [one for part in mine for one in _extrude_part(part, whole, floor_height, reasons)]
        found += _split_building(whole, raised, known, floor_height, min_area, reasons) if raised else [whole]
    for part in chain.from_iterable(own.values()):  # parts of buildings that were set aside
        found += _extrude_part(part, None, floor_height, reasons)
    return found


def _extrude_part(
    part: PartCandidate, whole: Building | None, floor_height: float, reasons: dict[str, list[str]]
) -> list[Building]:
    """Return a part from its lower end to its eaves; an empty list where it has no height."""
    building, stated = part.building, part.footprint
    levels_below = stated.min_level or 0.0
    low = stated.min_height or round(levels_below * floor_height, 2)
    height, source = _part_height(stated, whole, low + floor_height, floor_height)
    lowest, roof = low + PARTS.min_part_wall_m, building.roof
    if height < lowest and roof is not None and roof.height > 0:
        top, height = height + roof.height, lowest
        roof = replace(roof, height=round(top - height, 2)) if source == "height" else roof
    if height < lowest:
        reasons["parts of buildings that end no higher than they begin set aside"].append(building.id)
        return []
    levels = whole_levels(stated.levels, levels_below)
    extruded = replace(building, height=round(height, 2), height_source=source, levels=levels, roof=roof, raised=low)
    if whole is None:
        flat = Roof("flat", 0.0, confidence=PARTS.flat_roof_confidence)
        return [replace(extruded, roof=roof or flat, part_of=None)]
    return [_inherit(extruded, whole)]


def whole_levels(levels: float | None, below: float = 0.0) -> int | None:
    """Return the number of floors from stated levels without those below; None where none are stated."""
    return max(1, int(levels - below)) if levels else None


def _inherit(part: Building, whole: Building) -> Building:
    """Return a part with what its building states in its place."""
    return replace(
        part,
        name=part.name or whole.name,
        finish=_complete_finish(part.finish, whole.finish),
        base=whole.base if part.base is None else part.base,
        part_of=whole.id,
    )


def _part_height(stated: Footprint, whole: Building | None, lowest: float, floor_height: float) -> tuple[float, str]:
    """Return the height of a part and its source: stated, by its storeys, that of its building, or one storey."""
    if stated.height is not None:
        return stated.height, "height"
    if stated.levels is not None:
        return round(stated.levels * floor_height, 2), "levels"
    if whole is not None and whole.height >= lowest:
        return whole.height, whole.height_source
    return lowest, "default"


def _complete_finish(own: BuildingFinish, whole: BuildingFinish) -> BuildingFinish:
    """Return the finish of a part, whose unknown values are those of the whole building."""
    return BuildingFinish(
        whole.wall_colour if own.wall_colour is None else own.wall_colour,
        whole.roof_colour if own.roof_colour is None else own.roof_colour,
        whole.wall_material if own.wall_material is None else own.wall_material,
        whole.roof_material if own.roof_material is None else own.roof_material,
    )


def _split_building(
    whole: Building,
    parts: list[Building],
    footprints: Mapping[str, Footprint],
    floor_height: float,
    min_area: float,
    reasons: dict[str, list[str]],
) -> list[Building]:
    """Return the uncovered rest of a building and its parts, each on its support, with roofs."""
    left, whole = _subtract_parts(whole, parts, floor_height)
    levels = _stack_parts([replace(whole, footprint=left), *parts], whole.footprint)
    found = []
    for one in _remove_overlaps(levels):
        pieces = _clean_polygons(one.footprint, min_area if one.id == whole.id else 0.0)
        if not pieces and one.id != whole.id:
            reasons["parts of buildings inside of others left out"].append(one.id)
        if pieces and one.roof is None:
            largest = max(pieces, key=lambda piece: piece.area)
            one = _add_part_roof(replace(one, footprint=largest), footprints[one.id], levels)
        for number, piece in enumerate(pieces):
            id = one.id if len(pieces) == 1 else f"{one.id}-{number}"
            found.append(replace(one, id=id, footprint=piece, part_of=whole.id if id != whole.id else None))
    return found


def _subtract_parts(whole: Building, parts: Sequence[Building], floor_height: float) -> tuple[BaseGeometry, Building]:
    """Return the rest of a building's outline, and the building with its height there."""
    left = whole.footprint
    raised = []
    for part in parts:
        if part.raised <= whole.raised + PARTS.min_part_wall_m and part.height > whole.raised + PARTS.min_part_wall_m:
            left = shapely.difference(left, part.footprint)
        elif part.raised > whole.raised:
            raised.append(part)
    over = [part for part in raised if shapely.intersection(part.footprint, left).area > PARTS.max_overlap_m2]
    known = whole.height_source != "default"
    if over and not known:
        covered = shapely.intersection(shapely.union_all([part.footprint for part in over]), left).area
        known, lowest = covered > PARTS.min_covered_share * left.area, min(part.raised for part in over)
        whole = replace(whole, height=min(whole.height, lowest)) if known else whole
    carried = [
        (known and whole.height <= part.raised + floor_height)
        or _border_share(part, whole.footprint) < PARTS.min_open_border_share
        for part in over
    ]
    for part, is_carried in zip(over, carried, strict=True):
        if not is_carried:
            left = shapely.difference(left, part.footprint)
    return left, _flatten_roof(whole) if any(carried) else whole


def _flatten_roof(whole: Building) -> Building:
    """Return a building with a flat roof in place of an assumed one."""
    roof = whole.roof
    if roof is None or roof.confidence >= 1:
        return whole
    height = whole.height + (roof.height if whole.height_source == "height" else 0.0)
    return replace(whole, height=round(height, 2), roof=Roof("flat", 0.0, confidence=roof.confidence))


def _border_share(part: Building, outline: Polygon) -> float:
    """Return the share of a part's border on the border of its building."""
    border = part.footprint.boundary
    return float(shapely.intersection(border, outline.boundary.buffer(PARTS.border_tolerance_m)).length / border.length)


def _stack_parts(items: list[Building], outline: Polygon) -> list[Building]:
    """Raise parts inside or above others to the eaves below them; the first item is the building."""
    items = list(items)
    for number in sorted(range(1, len(items)), key=lambda i: items[i].height):
        part = items[number]
        others = [
            other for i, other in enumerate(items) if i != number and other.height < part.height - PARTS.min_part_wall_m
        ]
        while True:
            around = [one for one in others if one.raised <= part.raised < one.height]
            if not around or not _covers(around, part):
                break
            part = replace(part, raised=min(one.height for one in around))
        if part.raised > 0 and _border_share(part, outline) < PARTS.min_open_border_share:
            below = sorted((one for one in others if one.height <= part.raised), key=lambda one: -one.height)
            for count, one in enumerate(below, 1):
                if _covers(below[:count], part):
                    part = replace(part, raised=one.height)
                    break
        items[number] = part
    return items


def _covers(others: Sequence[Building], part: Building) -> bool:
    covered = shapely.union_all([one.footprint for one in others]).intersection(part.footprint)
    return bool(covered.area >= PARTS.min_support_share * part.footprint.area)


def _remove_overlaps(items: Sequence[Building]) -> Iterator[Building]:
    """Yield items without the area that higher or larger ones cover over their whole height."""
    done: list[Building] = []
    for one in sorted(items, key=lambda item: (-item.height, -item.footprint.area)):
        for other in done:
            inside = one.raised >= other.raised - PARTS.min_part_wall_m and one.height <= other.height
            if inside and one.footprint.intersection(other.footprint).area > PARTS.max_overlap_m2:
                one = replace(one, footprint=shapely.difference(one.footprint, other.footprint))
        done.append(one)
    yield from done


def _clean_polygons(left: BaseGeometry, min_area: float) -> list[Polygon]:
    """Return the polygons of an outline from west to east, without slivers and those under `min_area` m2."""
    opened = left.buffer(-PARTS.min_half_width_m, join_style="mitre").buffer(PARTS.min_half_width_m, join_style="mitre")
    if left.area - opened.area > PARTS.max_overlap_m2 or opened.area > left.area:
        left = shapely.make_valid(shapely.intersection(opened, left).simplify(PARTS.simplify_tolerance_m))
    pieces = [part for part in shapely.get_parts(left) if part.geom_type == "Polygon"]
    return sorted(
        (piece for piece in shapely.normalize(pieces) if piece.area > max(min_area, PARTS.max_overlap_m2)),
        key=lambda p: p.bounds,
    )


def _add_part_roof(part: Building, footprint: Footprint, levels: Sequence[Building]) -> Building:
    """Return a part with an assumed roof; flat below other parts or over low walls."""
    lowest = part.height - PARTS.min_part_wall_m
    above = [one.footprint for one in levels if one.id != part.id and one.raised >= lowest]
    if not any(part.footprint.intersection(one).area > PARTS.max_overlap_m2 for one in above):
        found = add_assumed_roof(part, footprint, attached=True)
        if found.height >= part.raised + ROOFS.min_wall_m:
            return found
    return replace(part, roof=Roof("flat", 0.0, confidence=PARTS.flat_roof_confidence))
