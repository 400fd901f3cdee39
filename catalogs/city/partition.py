"""Partition of a city into blocks along its streets.

Each building and street segment belongs to one block. The surroundings that a block reads are its halo. Everything
here is a function of location, so a local change leaves blocks elsewhere unchanged.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from catalogs.block.part import CityPartIds
from facade_core.core.types import Building, Street

# Radius of the halo: twice the default visibility range, plus the reach of ground features.
MIN_HALO_M = 120.0
# Shadows of a sun reach farther.
SHADOW_HALO_M = 160.0
# A panorama may show an own wall from 150 m, and is matched against surroundings of 60 m.
PANORAMA_HALO_M = 210.0

GridCell = tuple[int, int]


def halo_radius(*, sun: bool, panoramas: bool, visibility_range: float) -> float:
    """Return how far around a block its halo reaches, in metres."""
    return max(
        MIN_HALO_M,
        2 * visibility_range + 40,
        SHADOW_HALO_M if sun else 0.0,
        PANORAMA_HALO_M if panoramas else 0.0,
    )


def partition_city(
    buildings: Sequence[Building], segments: Sequence[Street], *, block_size: float, halo: float
) -> tuple[CityPartIds, ...]:
    """Partition a city into grid cells whose borders follow the nearest streets.

    All buildings inside a face of the street network belong to the cell that holds the face. A segment belongs to the
    block of the building nearest to its middle.

    Parameters
    ----------
    segments : streets cut at junctions.
    block_size : side of a grid cell in metres.
    halo : radius of the halo in metres.

    Returns
    -------
    Blocks, ordered by cell.
    """
    squares = _building_cells(buildings, segments, block_size)
    own: dict[GridCell, list[int]] = defaultdict(list)
    for index, square in enumerate(squares):
        own[square].append(index)
    footprints = [building.footprint for building in buildings]
    lines = [street.line for street in segments]
    walked: dict[GridCell, list[int]] = defaultdict(list)
    for segment, building in enumerate(_nearest_buildings(lines, buildings)):
        walked[squares[building]].append(segment)
    around, along = shapely.STRtree(footprints), shapely.STRtree(lines)
    cuts = []
    for square, core in sorted(own.items()):
        ways = walked[square]
        contents = [*(footprints[i] for i in core), *(lines[i] for i in ways)]
        nearby_buildings = np.setdiff1d(around.query(contents, predicate="dwithin", distance=halo)[1], core)
        nearby_streets = np.setdiff1d(along.query(contents, predicate="dwithin", distance=halo)[1], ways)
        cuts.append(
            CityPartIds(
                "x{}y{}".format(*square),
                _ids(buildings, core),
                _ids(segments, ways),
                _ids(buildings, nearby_buildings.tolist()),
                _ids(segments, nearby_streets.tolist()),
            )
        )
    return tuple(cuts)


def _ids(items: Sequence[Building | Street], indices: Iterable[int]) -> tuple[str, ...]:
    return tuple(items[index].id for index in indices)


def _building_cells(buildings: Sequence[Building], segments: Sequence[Street], block_size: float) -> list[GridCell]:
    """Return the grid cell of each building: of the street face around it, or its own."""
    places = [building.footprint.representative_point() for building in buildings]
    found = [_grid_cell(place, block_size) for place in places]
    faces = shapely.get_parts(shapely.polygonize([shapely.union_all([street.line for street in segments])]))
    if len(faces):
        of_face = [_grid_cell(face.representative_point(), block_size) for face in faces]
        place, face = shapely.STRtree(faces).query(places, predicate="within")
        for index, one in sorted(zip(place.tolist(), face.tolist(), strict=True)):
            found[index] = of_face[one]
    # all parts of a building belong to the block of the first part
    first: dict[str, int] = {}
    for index in sorted(range(len(buildings)), key=lambda i: buildings[i].id):
        first.setdefault(buildings[index].whole_id, index)
    return [found[first[building.whole_id]] for building in buildings]


def _grid_cell(place: shapely.Point, block_size: float) -> GridCell:
    return int(np.floor(place.x / block_size)), int(np.floor(place.y / block_size))


def _nearest_buildings(lines: Sequence[shapely.LineString], buildings: Sequence[Building]) -> list[int]:
    """Return the building nearest to the middle of each line; of several the first by id."""
    order = sorted(range(len(buildings)), key=lambda i: buildings[i].id)
    tree = shapely.STRtree([buildings[i].footprint for i in order])
    middles = shapely.line_interpolate_point(np.array(lines, object), 0.5, normalized=True)
    line, nearest = tree.query_nearest(middles, all_matches=True)
    first = np.full(len(lines), len(buildings))
    np.minimum.at(first, line, nearest)
    return [order[i] for i in first.tolist()]
