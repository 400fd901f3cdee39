"""Streets of a block from centreline pieces: clipped, projected and merged by name."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import LineString

from catalogs.crs import coordinate_transform
from catalogs.features import Centreline, CentrelinesAndGround, Fault, natural_sort_key
from catalogs.readers.settings import LIMITS
from facade_core.core.arrays import ObjectArray
from facade_core.core.types import Street

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon
    from shapely.geometry.base import BaseGeometry

# Distance between two points of a line.
MAX_VERTEX_SPACING_M = 20_000.0
# Shorter streets are errors of mappers, or remainders of clipping.
MIN_STREET_LENGTH_M = 1.0


def build_block_streets(
    source: CentrelinesAndGround, crs: CRS, *, area: Polygon | None
) -> tuple[tuple[Street, ...], tuple[Fault, ...]]:
    """Build streets in the metric frame from centreline pieces.

    Pieces of one name that meet end to end become one line. A street's id is s + the number of its first piece (s12),
    with -0,
    -1, ... if that piece is cut into several streets; its direction is that piece's. The result does not depend on
    the order of the pieces.

    Parameters
    ----------
    source : pieces; a source without a frame is in the block's.
    crs : metric frame of the block.
    area : polygon in `crs`; lines are clipped to it, and faults outside are dropped.

    Returns
    -------
    Streets and faults, each ordered by id. A street longer than LIMITS.max_street_length_m is a fault, and so is one shorter
    than MIN_STREET_LENGTH_M, unless clipping made it short.
    """
    pieces = sorted(source.items, key=lambda piece: (natural_sort_key(piece.id), shapely.to_wkb(piece.line) or b""))
    lines = project_lines([piece.line for piece in pieces], source.crs, crs)
    broken = project_lines([fault.place for fault in source.faults], source.crs, crs)
    faults = [fault for fault, place in zip(source.faults, broken, strict=True) if _touches_area(place, area)]
    by_name: dict[str, list[tuple[Centreline, LineString]]] = defaultdict(list)
    for piece, line in zip(pieces, lines, strict=True):
        if reason := _line_problem(piece.line, line):
            if _touches_area(line, area):
                faults.append(Fault(piece.id, "street", reason, piece.line))
            continue
        for part in _clip_line(line, area):
            by_name[piece.name or ""].append((piece, part))

    whole: dict[str, float] = defaultdict(float)
    for piece, line in zip(pieces, lines, strict=True):
        whole[piece.id] = max(whole[piece.id], line.length if line is not None else 0.0)
    merged: dict[str, list[tuple[LineString, str | None]]] = defaultdict(list)
    for name in sorted(by_name):
        for first, line in _merge_pieces(by_name[name]):
            if line.length > LIMITS.max_street_length_m:
                reason = (
                    f"is {line.length / 1000:,.0f} km long within the block, over {LIMITS.max_street_length_m / 1000:g}: no "
                    "street is; draw it again, remove it, or give area"
                )
                faults.append(Fault(first.id, "street", reason, first.line))
            elif line.length >= MIN_STREET_LENGTH_M:
                merged[f"s{first.id.lstrip('w')}"].append((line, name or None))
            elif whole[first.id] < MIN_STREET_LENGTH_M:
                reason = f"is {line.length:.2g} m long and joins no other of its name; remove it, or draw it to its end"
                faults.append(Fault(first.id, "street", reason, first.line))
    streets = []
    for id in sorted(merged, key=natural_sort_key):
        found = sorted(merged[id], key=lambda entry: entry[0].coords[0])
        free = (one for number in count() if (one := f"{id}-{number}") not in merged)
        for line, street_name in found:
            streets.append(Street(id if len(found) == 1 else next(free), street_name, line))
    return tuple(streets), tuple(sorted(faults, key=lambda fault: natural_sort_key(fault.id)))


def clip_centrelines(
    source: CentrelinesAndGround, crs: CRS, around: Polygon, area: Polygon | None
) -> tuple[CentrelinesAndGround, tuple[str, ...]]:
    """Clip centrelines to a polygon, and list the ids of pieces that leave it within the area.

    Returns the source unchanged, in its own frame, if no piece leaves the polygon.

    Parameters
    ----------
    crs : metric frame of the block.
    around : polygon in `crs`.
    area : polygon in `crs` of the block's area, None if it has none.
    """
    lines = project_lines([piece.line for piece in source.items], source.crs, crs)
    sound = [not _line_problem(piece.line, line) for piece, line in zip(source.items, lines, strict=True)]
    inside = [not one or around.covers(line) for one, line in zip(sound, lines, strict=True)]
    if all(inside):
        return source, ()
    items, cut = [], []
    for piece, line, whole in zip(source.items, lines, inside, strict=True):
        items += [replace(piece, line=part) for part in ([line] if whole else _clip_line(line, around))]
        if not whole and _touches_area(line, area):
            cut.append(piece.id)
    places = project_lines([fault.place for fault in source.faults], source.crs, crs)
    faults = [replace(fault, place=place) for fault, place in zip(source.faults, places, strict=True)]
    return replace(source, crs=None, items=tuple(items), faults=tuple(faults)), tuple(cut)


def project_lines(geometries: Sequence[BaseGeometry | None], source: str | None, crs: CRS) -> ObjectArray:
    """Return geometries in a metric frame, without heights; those of a source without a frame are in it."""
    stated = np.empty(len(geometries), dtype=object)
    stated[:] = geometries
    flat: ObjectArray = shapely.force_2d(stated)
    if source is None:
        return flat
    projected: ObjectArray = shapely.transform(flat, coordinate_transform(source, crs), interleaved=False)
    return projected


def _line_problem(stated: LineString | None, line: LineString | None) -> str | None:
    """Return why a line is no valid street, or None."""
    if stated is None or line is None or line.is_empty:
        return "has no coordinates; remove it, or draw it again"
    if not np.isfinite(shapely.get_coordinates(stated)).all():
        return "has coordinates that are no finite numbers; remove it, or draw it again"
    if not np.isfinite(shapely.get_coordinates(line)).all():
        return "has coordinates that the block's frame cannot hold; remove it, or check the frame of its file"
    if line.length == 0:
        return "has no length; remove it, or draw it to its end"
    stretch = float(np.hypot(*np.diff(shapely.get_coordinates(line), axis=0).T).max())
    if stretch > MAX_VERTEX_SPACING_M:
        return (
            f"has a stretch of {stretch / 1000:,.0f} km without a point; mend the point that lies apart, or remove it"
        )
    return None


def _touches_area(place: BaseGeometry | None, area: Polygon | None) -> bool:
    """Return whether finite coordinates reach into the area; an unknown place counts."""
    if area is None or place is None:
        return True
    known = shapely.get_coordinates(place)
    known = known[np.isfinite(known).all(axis=1)]
    return len(known) == 0 or bool(shapely.box(*known.min(axis=0), *known.max(axis=0)).intersects(area))


def _clip_line(line: LineString, area: Polygon | None) -> list[LineString]:
    inside = line if area is None else line.intersection(area)
    return [part for part in shapely.get_parts(inside) if part.geom_type == "LineString" and part.length > 0]


def _merge_pieces(pieces: list[tuple[Centreline, LineString]]) -> list[tuple[Centreline, LineString]]:
    """Join pieces end to end; return each joined line with the first of its pieces in the given order."""
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
