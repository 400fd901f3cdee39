"""Texel density of charts by their distance from the streets."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.walls import group_walls_into_runs

# Metres from a viewpoint up to which a chart that faces it has full and half density; all others have a quarter. A
# pixel of a picture 1,400 wide with a field of view of 75 degrees covers 1 / 57 m at 16 m.
FULL_DENSITY_M = 16.0
HALF_DENSITY_M = 48.0
# Texels per metre of the coarsest chart, so that a window has some eight texels.
MIN_TEXELS_PER_METRE = 8.0
# Free share of a wall up to which it counts as a party wall, which is hardly ever seen.
MAX_PARTY_WALL_SHARE = 0.05
# Charts per query: each is within reach of some twenty viewpoints.
CHARTS_PER_BATCH = 1 << 16


def texel_density(
    charts: Charts, free_share: Float64Array, viewpoints: Float64Array, texels_per_metre: float
) -> Float64Array:
    """Compute the texel density of charts: full, half or a quarter, by the nearest viewpoint in front.

    Occlusion does not count, so that a building elsewhere changes no chart. Walls round a bend share one density.

    Parameters
    ----------
    free_share : (n,) share of each chart without a neighbour against it; party walls get a quarter.
    viewpoints : (v, 3) metres.
    texels_per_metre : full density.

    Returns
    -------
    (n,) texels per metre.
    """
    nearest = np.where(free_share > MAX_PARTY_WALL_SHARE, _viewpoint_distances(charts, viewpoints), np.inf)
    for run in group_walls_into_runs(charts, np.flatnonzero(charts.kind == ChartKind.WALL)):
        nearest[run] = nearest[run].min()
    halved = (nearest > FULL_DENSITY_M).astype(int) + (nearest > HALF_DENSITY_M)
    return np.maximum(texels_per_metre / 2.0**halved, min_texel_density(texels_per_metre))


def min_texel_density(texels_per_metre: float) -> float:
    """Return the lowest density in texels per metre of a chart in an atlas."""
    possible = int(np.floor(np.log2(texels_per_metre / MIN_TEXELS_PER_METRE)))
    return texels_per_metre / 2.0 ** min(max(possible, 0), 2)


def _viewpoint_distances(charts: Charts, viewpoints: Float64Array) -> Float64Array:
    """Return the metres (n,) from each chart to the nearest viewpoint in front of it, inf beyond HALF_DENSITY_M."""
    nearest = np.full(len(charts), np.inf)
    if not len(viewpoints):
        return nearest
    places = shapely.STRtree(shapely.points(viewpoints[:, :2]))
    for first in range(0, len(charts), CHARTS_PER_BATCH):
        row, of = places.query(
            charts.boxes[first : first + CHARTS_PER_BATCH], predicate="dwithin", distance=HALF_DENSITY_M
        )
        chart = first + row
        along = charts.coordinates(chart, viewpoints[of])
        over = np.einsum("ij,ij->i", viewpoints[of] - charts.origin[chart], charts.normals()[chart])
        beside = along - np.clip(along, 0, charts.size[chart])
        metres = np.sqrt((beside**2).sum(axis=1) + over**2)
        np.minimum.at(nearest, chart[over > 0], metres[over > 0])
    return nearest
