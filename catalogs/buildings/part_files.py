"""Building parts in another file than their buildings, as Overture Maps publishes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from catalogs.crs import coordinate_transform
from catalogs.features import BuildingModels, Footprint, Footprints, Remark
from facade_core.core.arrays import ObjectArray

if TYPE_CHECKING:
    from pyproj import CRS

MISSING_PARTS_REASON = "buildings whose parts are missing, read as one outline; add the file of their parts"


class _Entry(NamedTuple):
    """Footprint of a source, with the numbers of both."""

    place: tuple[int, int]
    item: Footprint

    @property
    def source(self) -> int:
        """Return the number of the source."""
        return self.place[0]


def attach_parts(sources: Sequence[Footprints | BuildingModels], crs: CRS) -> tuple[Footprints | BuildingModels, ...]:
    """Return the sources with each part in the source of its building.

    A part names its building or is tagged as a part, and lies in the outline of the building. A building that states
    parts, and has none, gets a remark.

    Parameters
    ----------
    sources : sources with a CRS.
    crs : frame in which the outlines are compared.
    """
    entries = _list_entries(sources)
    if not _has_parts_elsewhere(entries):
        return tuple(sources)
    parts = [one for one in entries if one.item.whole_id or one.item.is_part]
    wholes = [one for one in entries if _is_whole(one)]
    hosts = _find_hosts(parts, wholes, sources, crs)
    return tuple(
        _exchange_parts(number, source, sources, entries, hosts) if isinstance(source, Footprints) else source
        for number, source in enumerate(sources)
    )


def _exchange_parts(
    number: int,
    source: Footprints,
    sources: Sequence[Footprints | BuildingModels],
    entries: Sequence[_Entry],
    hosts: Mapping[tuple[int, int], tuple[int, int]],
) -> Footprints:
    """Return a source with the parts of its buildings, and without those of others."""
    own = [one for one in entries if one.source == number]
    moved = [_move_to_frame(one, sources, source) for one in entries if hosts.get(one.place, (-1,))[0] == number]
    kept = [one.item for one in own if one.place not in hosts]
    remarks = (*source.remarks, *_note_missing_parts(own, hosts))
    return replace(source, items=(*kept, *moved), remarks=remarks)


def _list_entries(sources: Sequence[Footprints | BuildingModels]) -> list[_Entry]:
    return [
        _Entry((number, index), item)
        for number, source in enumerate(sources)
        if isinstance(source, Footprints)
        for index, item in enumerate(source.items)
    ]


def _has_parts_elsewhere(entries: Sequence[_Entry]) -> bool:
    several = len({entry.source for entry in entries}) > 1
    return any(one.item.whole_id or one.item.has_parts or (several and one.item.is_part) for one in entries)


def _note_missing_parts(entries: Sequence[_Entry], hosts: Mapping[tuple[int, int], tuple[int, int]]) -> list[Remark]:
    """Return a remark for each whole building that states parts and has none."""
    wholes = [one.item for one in entries if _is_whole(one) and one.place not in hosts.values()]
    return [Remark(item.id, MISSING_PARTS_REASON, item.outline) for item in wholes if item.has_parts]


def _is_whole(entry: _Entry) -> bool:
    return not entry.item.is_part and entry.item.shell is None


def _find_hosts(
    parts: Sequence[_Entry], wholes: Sequence[_Entry], sources: Sequence[Footprints | BuildingModels], crs: CRS
) -> dict[tuple[int, int], tuple[int, int]]:
    """Return the building of each part, both as numbers of source and item; parts without one are left out."""
    places = shapely.point_on_surface(_outlines_in_frame(parts, sources, crs))
    tree = shapely.STRtree(_outlines_in_frame(wholes, sources, crs))
    hosts = {}
    for part, place in zip(parts, places, strict=True):
        if place is None or place.is_empty:
            continue
        around = [wholes[index] for index in sorted(tree.query(place, predicate="within").tolist())]
        if host := _choose_host(part, [one for one in around if one.place != part.place]):
            hosts[part.place] = host.place
    return hosts


def _choose_host(part: _Entry, around: Sequence[_Entry]) -> _Entry | None:
    """Return the building that a part names, else for a tagged part one of its source, else any around it."""
    named = [one for one in around if one.item.id == part.item.whole_id]
    own = [one for one in around if one.source == part.source]
    return next(iter(named or ((own or around) if part.item.is_part else [])), None)


def _outlines_in_frame(
    entries: Sequence[_Entry], sources: Sequence[Footprints | BuildingModels], crs: CRS
) -> ObjectArray:
    outlines = np.array([one.item.outline for one in entries], dtype=object)
    numbers = np.array([one.source for one in entries], dtype=np.int64)
    for number in np.unique(numbers).tolist():
        stated = sources[number].crs
        assert stated is not None, "the block gives a frame to every source"
        mine = numbers == number
        flat = shapely.force_2d(outlines[mine])
        outlines[mine] = shapely.transform(flat, coordinate_transform(stated, crs), interleaved=False)
    return outlines


def _move_to_frame(part: _Entry, sources: Sequence[Footprints | BuildingModels], source: Footprints) -> Footprint:
    """Return a part in the frame of the source of its building."""
    outline, stated = part.item.outline, sources[part.source].crs
    if stated != source.crs:
        assert stated is not None, "the block gives a frame to every source"
        assert source.crs is not None, "the block gives a frame to every source"
        outline = shapely.transform(outline, coordinate_transform(stated, source.crs), interleaved=False)
    return replace(part.item, outline=outline, is_part=True)
