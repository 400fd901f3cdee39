"""Texel density of charts by their distance from the streets."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.settings import TEXEL_DENSITY
from facade_core.geometry.walls import group_walls_into_runs


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
    nearest = np.where(
        free_share > TEXEL_DENSITY.max_party_wall_share, _viewpoint_distances(charts, viewpoints), np.inf
    )
    for run in group_walls_into_runs(charts, np.flatnonzero(charts.kind == ChartKind.WALL)):
        nearest[run] = nearest[run].min()
    halved = (nearest > TEXEL_DENSITY.full_density_m).astype(int) + (nearest > TEXEL_DENSITY.half_density_m)
    return np.maximum(texels_per_metre / 2.0**halved, min_texel_density(texels_per_metre))


def min_texel_density(texels_per_metre: float) -> float:
    """Return the lowest density in texels per metre of a chart in an atlas."""
    possible = int(np.floor(np.log2(texels_per_metre / TEXEL_DENSITY.min_texels_per_metre)))
    return texels_per_metre / 2.0 ** min(max(possible, 0), 2)


def _viewpoint_distances(charts: Charts, viewpoints: Float64Array) -> Float64Array:
    """Return the metres (n,) from each chart to the nearest viewpoint in front of it, inf beyond `half_density_m`."""
    nearest = np.full(len(charts), np.inf)
    if not len(viewpoints):
        return nearest
    places = shapely.STRtree(shapely.points(viewpoints[:, :2]))
    for first in range(0, len(charts), TEXEL_DENSITY.charts_per_batch):
        row, of = places.query(
            charts.boxes[first : first + TEXEL_DENSITY.charts_per_batch],
            predicate="dwithin",
            distance=TEXEL_DENSITY.half_density_m,
        )
        chart = first + row
        along = charts.coordinates(chart, viewpoints[of])
        over = np.einsum("ij,ij->i", viewpoints[of] - charts.origin[chart], charts.normals()[chart])
        beside = along - np.clip(along, 0, charts.size[chart])
        metres = np.sqrt((beside**2).sum(axis=1) + over**2)
        np.minimum.at(nearest, chart[over > 0], metres[over > 0])
    return nearest
