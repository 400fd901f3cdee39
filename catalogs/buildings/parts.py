"""Parts of buildings, as in OpenStreetMap's "Simple 3D Buildings": they stand in place of the outline that they cover."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from catalogs.buildings.roofs import LEAST_WALL, under_roof
from catalogs.features import Footprint
from facade_core.core.types import Building, Finish, Roof

# A part lies in the outline that has over this share of it; one lies on others that have this share of it.
INSIDE, ON = 0.5, 0.95
# Walls of a part are at least this high, metres; narrower pieces than twice the second figure are slips of the mapper.
LEAST_M, NARROW_M = 0.3, 0.5
# A part less of whose border lies on its building's is not free below: it goes down to what is under it.
OPEN, BORDER_M = 0.1, 0.3
# Overlaps up to the first (m2) are slips, and so are corners so near to a line (m). A building that states no height ends below
# raised parts that cover over the third, a share, of it.
OVERLAP_M2, SLIP_M, MOSTLY = 1.0, 0.01, 0.5
# How sure it is that a part without a stated roof is flat, where none is assumed.
FLAT_SURE = 0.6


@dataclass(frozen=True)
class Stated:
    """What a source states of a part, or of a building that begins above the ground: its outline and id as a building, and the
    id of that of which it is a part, None where there is none."""

    building: Building
    stated: Footprint
    of: str | None


def hosts(outlines: Sequence[Polygon], part: Sequence[bool]) -> list[int]:
    """The outline (n,) that each part of a building lies in, -1 of others and where there is none: one that is no part, else
    a larger part."""
    found = np.full(len(outlines), -1)
    area = shapely.area(np.asarray(outlines, object)) if len(outlines) else np.empty(0)
    parts = np.flatnonzero(part)
    whole = np.flatnonzero(~np.asarray(part, bool))
    for among in (whole, parts):
        left = parts[found[parts] < 0]
        if not len(among) or not len(left):
            continue
        tree = shapely.STRtree([outlines[i] for i in among.tolist()])
        for one in left.tolist():
            near = among[tree.query(outlines[one], predicate="intersects")]
            near = near[(near != one) & (~np.isin(near, parts) | (found[near] < 0) & (area[near] > area[one]))]
            shared = [outlines[one].intersection(outlines[other]).area for other in near.tolist()]
            if shared and max(shared) > INSIDE * area[one]:
                found[one] = near[int(np.argmax(shared))]
    for one in np.flatnonzero(found >= 0).tolist():  # a part of a part that is one itself
        while found[found[one]] >= 0:
            found[one] = found[found[one]]
    return found.tolist()


def with_parts(
    wholes: Sequence[Building], parts: Sequence[Stated], storey: float, smallest: float, reasons: dict[str, list[str]]
) -> list[Building]:
    """The buildings and their parts.

    Wholes, of known height, are what they are where they have no parts. A part that states no height is as high as the
    building, its colours and materials are the building's where it states none. Parts stand in place of what they cover of
    the outline; what is left stays as the building, without pieces under `smallest` m2. Where a building ends by its own tags
    below a part, or where that lies all in it, it stays below the part too. `reasons` takes what is left out, with ids.
    """
    own: dict[str, list[Stated]] = defaultdict(list)
    every = list(wholes)
    for part in parts:
        if part.of is None:
            every += _of_height(part, None, storey, reasons)
        else:
            own[part.of].append(part)
    found = []
    for whole in every:
        mine = own.pop(whole.id, [])
        known = {one.building.id: one.stated for one in mine}
        raised = [one for part in mine for one in _of_height(part, whole, storey, reasons)]
        found += _pieces(whole, raised, known, storey, smallest, reasons) if raised else [whole]
    for left in own.values():  # of what is set aside itself
        found += [one for part in left for one in _of_height(part, None, storey, reasons)]
    return found


def _of_height(part: Stated, whole: Building | None, storey: float, reasons: dict[str, list[str]]) -> list[Building]:
    """A part from where it begins to its eaves; none where it ends below."""
    building, stated = part.building, part.stated
    low = stated.raised or round((stated.raised_levels or 0.0) * storey, 2)
    height, source = low + storey, "default"
    if stated.height is not None:
        height, source = stated.height, "height"
    elif stated.levels is not None:
        height, source = round(stated.levels * storey, 2), "levels"
    elif whole is not None and whole.height >= height:
        height, source = whole.height, whole.height_source
    roof = building.roof
    if height < low + LEAST_M and roof is not None and roof.height > 0:
        top, height = height + roof.height, low + LEAST_M
        roof = replace(roof, height=round(top - height, 2)) if source == "height" else roof
    if height < low + LEAST_M:
        reasons["parts of buildings that end no higher than they begin set aside"].append(building.id)
        return []
    if whole is None and roof is None:
        roof = Roof("flat", 0.0, confidence=FLAT_SURE)
    levels = stated.levels
    finish, name = building.finish, building.name
    if whole is not None:
        pairs = zip(_values(finish), _values(whole.finish), strict=True)
        finish = Finish(*(its if own is None else own for own, its in pairs))
        name = name or whole.name
    return [
        replace(
            building,
            height=round(height, 2),
            height_source=source,
            levels=max(1, int(levels - (stated.raised_levels or 0.0))) if levels else None,
            name=name,
            roof=roof,
            finish=finish,
            base=building.base if whole is None or building.base is not None else whole.base,
            raised=low,
            part_of=None if whole is None else whole.id,
        )
    ]


def _values(finish: Finish) -> tuple:
    return finish.wall_colour, finish.roof_colour, finish.wall_material, finish.roof_material


def _pieces(
    whole: Building,
    parts: list[Building],
    stated: Mapping[str, Footprint],
    storey: float,
    smallest: float,
    reasons: dict[str, list[str]],
) -> list[Building]:
    """What is left of a building, and its parts, each from what it stands on, with roofs."""
    left, whole = _left(whole, parts, storey)
    levels = _stacked([replace(whole, footprint=left), *parts], whole.footprint)
    found = []
    for one in _apart(levels):
        pieces = _polygons(one.footprint, smallest if one.id == whole.id else 0.0)
        if not pieces and one.id != whole.id:
            reasons["parts of buildings inside of others left out"].append(one.id)
        if pieces and one.roof is None:
            others = [other for other in levels if other.id != one.id]
            one = _with_roof(replace(one, footprint=max(pieces, key=lambda piece: piece.area)), stated[one.id], others)
        for number, piece in enumerate(pieces):
            id = one.id if len(pieces) == 1 else f"{one.id}-{number}"
            found.append(replace(one, id=id, footprint=piece, part_of=whole.id if id != whole.id else None))
    return found


def _left(whole: Building, parts: Sequence[Building], storey: float) -> tuple[BaseGeometry, Building]:
    """What parts leave of a building's outline; the building, as high as it is there."""
    left = whole.footprint
    raised = []
    for part in parts:
        if part.raised <= whole.raised + LEAST_M and part.height > whole.raised + LEAST_M:
            left = shapely.difference(left, part.footprint)
        elif part.raised > whole.raised:
            raised.append(part)
    over = [part for part in raised if shapely.intersection(part.footprint, left).area > OVERLAP_M2]
    known = whole.height_source != "default"
    if over and not known:
        covered = shapely.intersection(shapely.union_all([part.footprint for part in over]), left).area
        known, lowest = covered > MOSTLY * left.area, min(part.raised for part in over)
        whole = replace(whole, height=min(whole.height, lowest)) if known else whole
    carried = False
    for part in over:
        if (known and whole.height <= part.raised + storey) or _border_share(part, whole.footprint) < OPEN:
            carried = True
        else:
            left = shapely.difference(left, part.footprint)
    roof = whole.roof
    if carried and roof is not None and roof.confidence < 1:
        height = whole.height + (roof.height if whole.height_source == "height" else 0.0)
        whole = replace(whole, height=round(height, 2), roof=Roof("flat", 0.0, confidence=roof.confidence))
    return left, whole


def _border_share(part: Building, outline: Polygon) -> float:
    """The share of a part's border that lies on its building's."""
    border = part.footprint.boundary
    return float(shapely.intersection(border, outline.boundary.buffer(BORDER_M)).length / border.length)


def _stacked(items: list[Building], outline: Polygon) -> list[Building]:
    """A building, its first item, and its parts: those that stand in others begin at their eaves, as do those above others that
    are not open below."""
    items = list(items)
    for number in sorted(range(1, len(items)), key=lambda i: items[i].height):
        part = items[number]
        others = [other for i, other in enumerate(items) if i != number and other.height < part.height - LEAST_M]
        while True:
            around = [one for one in others if one.raised <= part.raised < one.height]
            if not around or not _covers(around, part):
                break
            part = replace(part, raised=min(one.height for one in around))
        if part.raised > 0 and _border_share(part, outline) < OPEN:
            below = sorted((one for one in others if one.height <= part.raised), key=lambda one: -one.height)
            for count, one in enumerate(below, 1):
                if _covers(below[:count], part):
                    part = replace(part, raised=one.height)
                    break
        items[number] = part
    return items


def _covers(others: Sequence[Building], part: Building) -> bool:
    covered = shapely.union_all([one.footprint for one in others]).intersection(part.footprint)
    return bool(covered.area >= ON * part.footprint.area)


def _apart(items: Sequence[Building]) -> Iterator[Building]:
    """Items without what others cover of them from below to above; the highest come first, then the largest."""
    done: list[Building] = []
    for one in sorted(items, key=lambda item: (-item.height, -item.footprint.area)):
        for other in done:
            inside = one.raised >= other.raised - LEAST_M and one.height <= other.height
            if inside and one.footprint.intersection(other.footprint).area > OVERLAP_M2:
                one = replace(one, footprint=shapely.difference(one.footprint, other.footprint))
        done.append(one)
    yield from done


def _polygons(left: BaseGeometry, smallest: float) -> list[Polygon]:
    """The polygons of what is left of an outline, from west to east, without slivers and those under `smallest` m2."""
    opened = left.buffer(-NARROW_M, join_style="mitre").buffer(NARROW_M, join_style="mitre")
    if left.area - opened.area > OVERLAP_M2 or opened.area > left.area:
        left = shapely.make_valid(shapely.intersection(opened, left).simplify(SLIP_M))
    pieces = [part for part in shapely.get_parts(left) if part.geom_type == "Polygon"]
    return sorted(
        (piece for piece in shapely.normalize(pieces) if piece.area > max(smallest, OVERLAP_M2)), key=lambda p: p.bounds
    )


def _with_roof(part: Building, stated: Footprint, others: Sequence[Building]) -> Building:
    """A part with an assumed roof; where others stand on it, or its walls would be too low, with a flat one."""
    above = [one.footprint for one in others if one.raised >= part.height - LEAST_M]
    if not any(part.footprint.intersection(one).area > OVERLAP_M2 for one in above):
        found = under_roof(part, stated, attached=True)
        if found.height >= part.raised + LEAST_WALL:
            return found
    return replace(part, roof=Roof("flat", 0.0, confidence=FLAT_SURE))
