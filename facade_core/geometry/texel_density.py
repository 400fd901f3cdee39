"""How many texels a metre charts get: as many as can be seen of them from a street."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.walls import bends

# Metres from which a chart in front of a viewpoint has all texels, and half of them; what is farther, or turns its back on all
# viewpoints, has a quarter. A pixel of a picture 1,400 wide with a field of view of 75 degrees covers 1 / 57 m at 16 m.
NEAR_M, FAR_M = 16.0, 48.0
# No chart is made so coarse that a window has fewer than some eight texels.
LEAST = 8.0
# A wall of which no larger share stands free of neighbours is hardly ever seen.
PARTY = 0.05
# Charts that are looked at together: each is within reach of some twenty viewpoints.
AT_ONCE = 1 << 16


def texel_density(
    charts: Charts, free_share: np.ndarray, viewpoints: np.ndarray, texels_per_metre: float
) -> np.ndarray:
    """Texels per metre of each chart, (n,): `texels_per_metre`, half or a quarter of it, by how near one of the viewpoints
    (v, 3), metres, that the chart faces comes to it; a quarter where it stands against neighbours, by its free share (n,).
    Walls that go round a bend together are alike.

    What may stand between does not count: a house built or torn down elsewhere changes no other chart.
    """
    nearest = np.where(free_share > PARTY, _nearest(charts, viewpoints), np.inf)
    for run in bends(charts, np.flatnonzero(charts.kind == ChartKind.WALL)):
        nearest[run] = nearest[run].min()
    halved = (nearest > NEAR_M).astype(int) + (nearest > FAR_M)
    return np.maximum(texels_per_metre / 2.0**halved, coarsest(texels_per_metre))


def coarsest(texels_per_metre: float) -> float:
    """The fewest texels a metre that any chart of an atlas has."""
    possible = int(np.floor(np.log2(texels_per_metre / LEAST)))
    return texels_per_metre / 2.0 ** min(max(possible, 0), 2)


def _nearest(charts: Charts, viewpoints: np.ndarray) -> np.ndarray:
    """Metres (n,) from each chart's rectangle to the nearest viewpoint before its plane, inf where none is within FAR_M."""
    nearest = np.full(len(charts), np.inf)
    if not len(viewpoints):
        return nearest
    places = shapely.STRtree(shapely.points(viewpoints[:, :2]))
    for first in range(0, len(charts), AT_ONCE):
        row, of = places.query(charts.boxes[first : first + AT_ONCE], predicate="dwithin", distance=FAR_M)
        chart = first + row
        along = charts.coordinates(chart, viewpoints[of])
        over = np.einsum("ij,ij->i", viewpoints[of] - charts.origin[chart], charts.normal()[chart])
        beside = along - np.clip(along, 0, charts.size[chart])
        metres = np.sqrt((beside**2).sum(axis=1) + over**2)
        np.minimum.at(nearest, chart[over > 0], metres[over > 0])
    return nearest
