"""Search for the most densely built square of a map, as a first block of a city."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from catalogs.buildings.extents import Bounds, BuildingSource, locate_boxes
from catalogs.buildings.settings import SITES
from catalogs.crs import EARTH_RADIUS_M


def square_bounds(longitude: float, latitude: float, size: float) -> Bounds:
    """Return (west, south, east, north) in degrees of a square around a point.

    Parameters
    ----------
    longitude, latitude : centre, degrees.
    size : length of a side, metres.
    """
    up = math.degrees(size / 2 / EARTH_RADIUS_M)
    right = up / math.cos(math.radians(latitude))
    return longitude - right, latitude - up, longitude + right, latitude + up


def densest_building_square(sources: Sequence[BuildingSource], size: float) -> Bounds | None:
    """Return the square of `size` metres in which the bounding boxes of buildings cover most.

    Ties go to the westernmost, then to the southernmost square.

    Parameters
    ----------
    sources : footprints and models; sources without a CRS are ignored.
    size : length of a side, metres.

    Returns
    -------
    (west, south, east, north) in degrees, or None without a building of a plausible size.
    """
    found = [locate_boxes(source.crs, source.bounding_boxes()) for source in sources if source.crs and source.items]
    corners = np.concatenate(
        [places.corners[places.size <= SITES.max_building_size_m] for places in found] or [np.empty((0, 4, 2))]
    )
    if not len(corners):
        return None
    middle = corners.mean(axis=1)
    step = size / SITES.square_steps_per_side
    up = math.degrees(step / EARTH_RADIUS_M)
    # sparse cells: boxes far apart would need a large grid
    row = np.floor(middle[:, 1] / up).astype(np.int64)
    right = up / np.cos(np.radians(np.median(middle[:, 1])))
    column = np.floor(middle[:, 0] / right).astype(np.int64)
    spans = np.ptp(corners, axis=1) / (right, up)
    cells, cell = np.unique(np.column_stack([column, row]), axis=0, return_inverse=True)
    covered = np.bincount(cell.ravel(), weights=spans.prod(axis=1))
    # candidate squares contain at least one occupied cell
    begins = cells[:, None] - np.stack(
        np.meshgrid(range(SITES.square_steps_per_side), range(SITES.square_steps_per_side), indexing="ij"), -1
    ).reshape(-1, 2)
    squares, square = np.unique(begins.reshape(-1, 2), axis=0, return_inverse=True)
    within = np.bincount(
        square.ravel(), weights=np.repeat(covered, SITES.square_steps_per_side * SITES.square_steps_per_side)
    )
    west, south = squares[within.argmax()]
    return (
        float(west * right),
        float(south * up),
        float((west + SITES.square_steps_per_side) * right),
        float((south + SITES.square_steps_per_side) * up),
    )
