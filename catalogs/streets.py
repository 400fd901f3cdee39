"""From centreline pieces as a source states them to the streets of a block: cut, projected, merged by name."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import LineString

from catalogs.features import Centreline, Centrelines, natural_order
from facade_core.types import Street

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

SHORTEST = 1.0  # m; what the area's border leaves of a street may be a crumb


def block_streets(source: Centrelines, crs: CRS, *, area: Polygon | None) -> tuple[Street, ...]:
    """Streets in the metric frame, ordered by id: pieces of one name that meet end to end become one line.

    area: polygon in the frame; lines are clipped to it. A street's id is s + the number of its first piece in id order (s12),
    with -0, -1, ... where one piece is cut into several streets; its direction is that piece's. The result
    does not depend on the order of the pieces.
    """
    if not source.items:
        return ()
    pieces = sorted(source.items, key=lambda piece: (natural_order(piece.id), piece.line.wkb))
    lines = _projected([piece.line for piece in pieces], source.crs, crs)
    by_name: dict[str, list[tuple[Centreline, LineString]]] = defaultdict(list)
    for piece, line in zip(pieces, lines, strict=True):
        for part in _clipped(line, area):
            by_name[piece.name or ""].append((piece, part))

    merged: dict[str, list[tuple[LineString, str | None]]] = defaultdict(list)
    for name in sorted(by_name):
        for first, line in _merged(by_name[name]):
            if line.length >= SHORTEST:
                merged[f"s{first.id.lstrip('w')}"].append((line, name or None))
    streets = []
    for id in sorted(merged, key=natural_order):
        found = sorted(merged[id], key=lambda entry: entry[0].coords[0])
        for index, (line, street_name) in enumerate(found):
            streets.append(Street(id if len(found) == 1 else f"{id}-{index}", street_name, line))
    return tuple(streets)


def _projected(lines: Sequence[LineString], source: str, crs: CRS) -> np.ndarray:
    from pyproj import Transformer

    to_frame = Transformer.from_crs(source, crs, always_xy=True)
    flat = shapely.force_2d(np.array(lines, dtype=object))
    return shapely.transform(flat, to_frame.transform, interleaved=False)


def _clipped(line: LineString, area: Polygon | None) -> list[LineString]:
    if not np.isfinite(shapely.get_coordinates(line)).all():
        return []
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
