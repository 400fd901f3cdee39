"""From centreline pieces as a source states them to the streets of a block: cut, projected, merged by name."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from shapely import LineString

from catalogs.crs import coordinate_transform
from catalogs.features import Centreline, Centrelines, Fault, natural_sort_key
from catalogs.readers.limits import MAX_STREET_LENGTH_M
from facade_core.core.types import Street

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

LONGEST_STRETCH = 20_000.0  # m between two points of a line
SHORTEST = 1.0  # m; what is shorter is a slip of the mapper, or a crumb that the area's border leaves


def block_streets(
    source: Centrelines, crs: CRS, *, area: Polygon | None
) -> tuple[tuple[Street, ...], tuple[Fault, ...]]:
    """Streets in the metric frame, ordered by id, and the broken ones, likewise: pieces of one name that meet end to end
    become one line.

    area: polygon in the frame; lines are clipped to it, and faults outside of it left out. A source that states no frame is
    in the block's. A street's id is s + the number of its first piece in id order (s12), with -0, -1, ... where one
    piece is cut into several streets; its direction is that piece's. A street longer than LONGEST_STREET is a fault, and one
    shorter than SHORTEST, unless clipping made it so. The result does not depend on the order of the pieces.
    """
    pieces = sorted(source.items, key=lambda piece: (natural_sort_key(piece.id), shapely.to_wkb(piece.line) or b""))
    lines = _projected([piece.line for piece in pieces], source.crs, crs)
    broken = _projected([fault.place for fault in source.faults], source.crs, crs)
    faults = [fault for fault, place in zip(source.faults, broken, strict=True) if _touches(place, area)]
    by_name: dict[str, list[tuple[Centreline, LineString]]] = defaultdict(list)
    for piece, line in zip(pieces, lines, strict=True):
        if reason := _broken(piece.line, line):
            if _touches(line, area):
                faults.append(Fault(piece.id, "street", reason, piece.line))
            continue
        for part in _clipped(line, area):
            by_name[piece.name or ""].append((piece, part))

    whole: dict[str, float] = defaultdict(float)
    for piece, line in zip(pieces, lines, strict=True):
        whole[piece.id] = max(whole[piece.id], line.length if line is not None else 0.0)
    merged: dict[str, list[tuple[LineString, str | None]]] = defaultdict(list)
    for name in sorted(by_name):
        for first, line in _merged(by_name[name]):
            if line.length > MAX_STREET_LENGTH_M:
                reason = (
                    f"is {line.length / 1000:,.0f} km long within the block, over {MAX_STREET_LENGTH_M / 1000:g}: no street is; "
                    "draw it again, remove it, or give area"
                )
                faults.append(Fault(first.id, "street", reason, first.line))
            elif line.length >= SHORTEST:
                merged[f"s{first.id.lstrip('w')}"].append((line, name or None))
            elif whole[first.id] < SHORTEST:
                reason = f"is {line.length:.2g} m long and joins no other of its name; remove it, or draw it to its end"
                faults.append(Fault(first.id, "street", reason, first.line))
    streets = []
    for id in sorted(merged, key=natural_sort_key):
        found = sorted(merged[id], key=lambda entry: entry[0].coords[0])
        for index, (line, street_name) in enumerate(found):
            streets.append(Street(id if len(found) == 1 else f"{id}-{index}", street_name, line))
    return tuple(streets), tuple(sorted(faults, key=lambda fault: natural_sort_key(fault.id)))


def followed(
    source: Centrelines, crs: CRS, around: Polygon, area: Polygon | None
) -> tuple[Centrelines, tuple[str, ...]]:
    """The centrelines in the metric frame as far as they lie in a polygon in it, and the ids of those that leave it within the
    area; the source itself where none does."""
    lines = _projected([piece.line for piece in source.items], source.crs, crs)
    sound = [not _broken(piece.line, line) for piece, line in zip(source.items, lines, strict=True)]
    inside = [not one or around.covers(line) for one, line in zip(sound, lines, strict=True)]
    if all(inside):
        return source, ()
    items, cut = [], []
    for piece, line, whole in zip(source.items, lines, inside, strict=True):
        items += [replace(piece, line=part) for part in ([line] if whole else _clipped(line, around))]
        if not whole and _touches(line, area):
            cut.append(piece.id)
    places = _projected([fault.place for fault in source.faults], source.crs, crs)
    faults = [replace(fault, place=place) for fault, place in zip(source.faults, places, strict=True)]
    return replace(source, crs=None, items=tuple(items), faults=tuple(faults)), tuple(cut)


def _projected(geometries: Sequence[Any], source: str | None, crs: CRS) -> np.ndarray:
    flat = np.empty(len(geometries), dtype=object)
    flat[:] = geometries
    flat = shapely.force_2d(flat)
    if source is None:
        return flat
    return shapely.transform(flat, coordinate_transform(source, crs), interleaved=False)


def _broken(stated: LineString | None, line: LineString | None) -> str | None:
    """Why a line, as stated and in the frame, is no street; None where it is one."""
    if stated is None or line is None or line.is_empty:
        return "has no coordinates; remove it, or draw it again"
    if not np.isfinite(shapely.get_coordinates(stated)).all():
        return "has coordinates that are no finite numbers; remove it, or draw it again"
    if not np.isfinite(shapely.get_coordinates(line)).all():
        return "has coordinates that the block's frame cannot hold; remove it, or check the frame of its file"
    if line.length == 0:
        return "has no length; remove it, or draw it to its end"
    stretch = float(np.hypot(*np.diff(shapely.get_coordinates(line), axis=0).T).max())
    if stretch > LONGEST_STRETCH:
        return (
            f"has a stretch of {stretch / 1000:,.0f} km without a point; mend the point that lies apart, or remove it"
        )
    return None


def _touches(place: Any, area: Polygon | None) -> bool:
    """Whether what is known of a place reaches into the area; a place of which nothing is known counts."""
    if area is None or place is None:
        return True
    known = shapely.get_coordinates(place)
    known = known[np.isfinite(known).all(axis=1)]
    return len(known) == 0 or bool(shapely.box(*known.min(axis=0), *known.max(axis=0)).intersects(area))


def _clipped(line: LineString, area: Polygon | None) -> list[LineString]:
    inside = line if area is None else line.intersection(area)
    return [part for part in shapely.get_parts(inside) if part.geom_type == "LineString" and part.length > 0]


def _merged(pieces: list[tuple[Centreline, LineString]]) -> list[tuple[Centreline, LineString]]:
    """Join pieces end to end; each joined line with the first piece (in the given order) that it holds."""
    joined = shapely.get_parts(shapely.line_merge(shapely.multilinestrings([line for _, line in pieces])))
    owner: dict[tuple[tuple[float, ...], tuple[float, ...]], int] = {}
    for index in reversed(range(len(pieces))):
        coords = list(pieces[index][1].coords)
        owner.update(dict.fromkeys(zip(coords, coords[1:], strict=False), index))
    result = []
    for line in joined:
        coords = list(line.coords)
        forward = [owner.get(pair, len(pieces)) for pair in zip(coords, coords[1:], strict=False)]
        backward = [owner.get(pair, len(pieces)) for pair in zip(coords[1:], coords, strict=False)]
        first = min(*forward, *backward)
        result.append((pieces[first][0], line if first in forward else line.reverse()))
    return result
