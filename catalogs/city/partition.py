"""A city cut into blocks along its streets: every building and every segment of a street is of one block, and what lies around
that is read is its context. All of it is a function of place: a change here leaves the blocks elsewhere as they are."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from facade_core.core.types import Building, Street

# Buildings and streets this near to a block's own are its context, metres: twice as far as a viewpoint sees by default, and as
# far as what is nearest to any ground of its own may lie from another; with a sun shadows reach farther; of a panorama that
# shows one of its walls from 150 m the surroundings, 60 m, are matched.
CONTEXT_M, SHADOWS_M, PICTURED_M = 120.0, 160.0, 210.0

Square = tuple[int, int]


@dataclass(frozen=True)
class Cut:
    """A block of a city: its name; ids of its own buildings and of its segments of streets; context and passing, those around
    it, likewise. All in the city's order."""

    name: str
    buildings: tuple[str, ...]
    streets: tuple[str, ...]
    context: tuple[str, ...]
    passing: tuple[str, ...]


def reach_of(*, sun: bool, panoramas: bool, visibility_range: float) -> float:
    """How far around a block its context lies, metres."""
    return max(
        CONTEXT_M,
        2 * visibility_range + 40,
        SHADOWS_M if sun else 0.0,
        PICTURED_M if panoramas else 0.0,
    )


def cut_city(
    buildings: Sequence[Building], segments: Sequence[Street], *, metres: float, reach: float
) -> tuple[Cut, ...]:
    """The blocks of a city, by name: squares of `metres` of its frame, each drawn to the streets next to it.

    What streets enclose is of the square in which it lies, and so are all buildings in it; a segment is of the block next to
    its middle.
    """
    squares = _squares(buildings, segments, metres)
    own: dict[Square, list[int]] = defaultdict(list)
    for index, square in enumerate(squares):
        own[square].append(index)
    footprints = [building.footprint for building in buildings]
    lines = [street.line for street in segments]
    walked: dict[Square, list[int]] = defaultdict(list)
    for segment, building in enumerate(_next_to(lines, buildings)):
        walked[squares[building]].append(segment)
    around, along = shapely.STRtree(footprints), shapely.STRtree(lines)
    cuts = []
    for square, mine in sorted(own.items()):
        ways = walked[square]
        held = [*(footprints[i] for i in mine), *(lines[i] for i in ways)]
        near = np.setdiff1d(around.query(held, predicate="dwithin", distance=reach)[1], mine)
        passing = np.setdiff1d(along.query(held, predicate="dwithin", distance=reach)[1], ways)
        cuts.append(
            Cut(
                "x{}y{}".format(*square),
                tuple(buildings[i].id for i in mine),
                tuple(segments[i].id for i in ways),
                tuple(buildings[i].id for i in near.tolist()),
                tuple(segments[i].id for i in passing.tolist()),
            )
        )
    return tuple(cuts)


def _squares(buildings: Sequence[Building], segments: Sequence[Street], metres: float) -> list[Square]:
    """The square of each building: of the face of the streets' network that it stands in, else its own."""
    places = [building.footprint.representative_point() for building in buildings]
    found = [_square(place, metres) for place in places]
    faces = shapely.get_parts(shapely.polygonize([shapely.union_all([street.line for street in segments])]))
    if len(faces):
        of_face = [_square(face.representative_point(), metres) for face in faces]
        place, face = shapely.STRtree(faces).query(places, predicate="within")
        for index, one in sorted(zip(place.tolist(), face.tolist(), strict=True)):
            found[index] = of_face[one]
    # the parts of a house are of one block: that of the first of them
    first: dict[str, int] = {}
    for index in sorted(range(len(buildings)), key=lambda i: buildings[i].id):
        first.setdefault(buildings[index].house, index)
    return [found[first[building.house]] for building in buildings]


def _square(place: shapely.Point, metres: float) -> Square:
    return int(np.floor(place.x / metres)), int(np.floor(place.y / metres))


def _next_to(lines: Sequence[shapely.LineString], buildings: Sequence[Building]) -> list[int]:
    """The building that is nearest to the middle of each line; of several the first by its id."""
    order = sorted(range(len(buildings)), key=lambda i: buildings[i].id)
    tree = shapely.STRtree([buildings[i].footprint for i in order])
    middles = shapely.line_interpolate_point(np.array(lines, object), 0.5, normalized=True)
    line, nearest = tree.query_nearest(middles, all_matches=True)
    first = np.full(len(lines), len(buildings))
    np.minimum.at(first, line, nearest)
    return [order[i] for i in first.tolist()]
