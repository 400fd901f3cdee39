"""Buildings known by wall rectangles only: a JSON object of walls by building."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely import LineString, MultiPolygon, Polygon

from catalogs.crs import metres_per_height_unit
from catalogs.features import Fault, Footprint, Footprints
from catalogs.reader_errors import fault_reason
from catalogs.readers.json_text import load_json
from catalogs.readers.settings import LIMITS, MODELS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.types import Roof

FLAT_ROOF = Roof("flat", 0.0, confidence=0.5)
_EXPECTED_JSON = '{"crs": "EPSG:n", "walls": {building: {wall: [[x, y, z], ...]}}}'


def read_footprints_from_walls(path: Path, lod: str | None = None) -> Footprints:
    """Read one footprint per building of a JSON object of walls.

    The format is {"crs": ..., "walls": {building: {wall: [[x, y, z], ...]}}}. Corners are in the units of `crs` in the
    order of the ring; the first two run from left to right as seen from outside. Three or more walls that meet end to
    end close an outline. Other walls get an outline of MODELS.assumed_depth_m behind them. The height is that of the walls
    and the roof is flat.

    Parameters
    ----------
    path : file.
    lod : ignored, since walls have no level of detail.

    Raises
    ------
    InputError
        Where the file is no such JSON.
    """
    content = load_json(path)
    walls = content.get("walls") if isinstance(content, dict) else None
    if not isinstance(content, dict) or not isinstance(walls, dict):
        raise InputError(f"{path} has no walls; give {_EXPECTED_JSON}")
    crs = content.get("crs")
    if crs is not None and not isinstance(crs, str):
        raise InputError(f'{path}: crs is {crs!r}; give a text such as "EPSG:28992"')
    unit = metres_per_height_unit(crs)
    items, faults = [], []
    for building, stated in walls.items():
        try:
            items.append(_parse_building(building, stated, unit))
        except ValueError as reason:
            faults.append(Fault(building, "building", str(reason)))
        except Exception as error:  # GEOS raises its own errors
            faults.append(Fault(building, "building", fault_reason(error)))
    return Footprints(crs, tuple(items), faults=tuple(faults))


def _parse_building(name: str, walls: object, metres_per_unit: float) -> Footprint:
    """Return the footprint of a building.

    Raises
    ------
    ValueError
        With the reason and the remedy, where the walls bound no area.
    """
    if not isinstance(walls, Mapping) or not walls:
        raise ValueError("it has no wall; give it walls, or take it out of the file")
    rings = {wall: _parse_ring(wall, corners) for wall, corners in walls.items()}
    feet = [_base_line(wall, ring) for wall, ring in rings.items()]
    outlines = [outline for chain in _connect_base_lines(feet) for outline in _outline_polygons(chain)]
    body = shapely.normalize(shapely.union_all(outlines))
    heights = np.concatenate([ring[:, 2] for ring in rings.values()])
    heights *= metres_per_unit
    base = float(heights.min())
    assert isinstance(body, Polygon | MultiPolygon)
    # the height of walls excludes the roof, so that no roof is subtracted
    return Footprint(name, body, float(heights.max()) - base, None, None, base, roof=FLAT_ROOF)


def _parse_ring(wall: str, corners: ArrayLike) -> Float64Array:
    """Return the corners (n, 3) of a wall."""
    try:
        ring = np.asarray(corners, np.float64)
    except (TypeError, ValueError, OverflowError):
        ring = np.empty(0)
    if ring.ndim != 2 or ring.shape[1] != 3 or len(ring) < 3 or not (np.abs(ring) < LIMITS.max_coordinate).all():
        raise ValueError(f"wall {wall} is no list of three or more [x, y, z] numbers; mend it")
    return ring


def _base_line(wall: str, ring: Float64Array) -> Float64Array:
    """Return the line (2, 2) at the foot of a wall, from left to right as seen from outside."""
    apart = np.linalg.norm(ring[:, None, :2] - ring[None, :, :2], axis=2)
    a, b = sorted(np.unravel_index(apart.argmax(), apart.shape))
    foot = np.array([ring[a, :2], ring[b, :2]])
    if apart.max() < MODELS.wall_tolerance_m or np.ptp(ring[:, 2]) < MODELS.wall_tolerance_m:
        raise ValueError(f"wall {wall} has no area; mend it")
    if shapely.distance(LineString(foot), shapely.points(ring[:, :2])).max() > MODELS.wall_tolerance_m:
        raise ValueError(f"wall {wall} does not stand upright; give walls as vertical rectangles")
    along = foot[1] - foot[0]
    first = (ring[:, :2] - foot[0]) @ along
    return foot if first[0] <= first[np.flatnonzero(np.abs(first - first[0]) > 1e-6)[0]] else foot[::-1]


def _connect_base_lines(feet: list[Float64Array]) -> list[Float64Array]:
    """Return polylines (n, 2) of base lines that meet end to end, in the given order."""
    chains: list[list[Float64Array]] = []
    for foot in feet:
        if chains and np.linalg.norm(chains[-1][-1] - foot[0]) <= MODELS.wall_tolerance_m:
            chains[-1].append(foot[1])
        else:
            chains.append([foot[0], foot[1]])
    return [np.array(chain) for chain in chains]


def _outline_polygons(chain: Float64Array) -> list[Polygon]:
    closed = Polygon(chain) if len(chain) >= 4 else Polygon()
    if closed.is_valid and closed.area > 0:
        return [closed]
    bodies = []
    for a, b in zip(chain[:-1], chain[1:], strict=True):
        left = np.array([a[1] - b[1], b[0] - a[0]]) * MODELS.assumed_depth_m / np.linalg.norm(b - a)
        bodies.append(Polygon([a, b, b + left, a + left]))
    return bodies
