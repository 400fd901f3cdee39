"""Raster of a chart with its surroundings, so that neighbouring pieces match."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.geometry.charts import CORNER_SHARES, Charts, raster_sizes

# Coplanar pieces: cosine between normals, and distance.
MIN_COPLANAR_COSINE = 0.98
MAX_PLANE_GAP_M = 0.5

# Reads rows and columns of a chart's raster: colour (h, w, 3) and provenance (h, w).
ChartReader = Callable[[int, slice, slice], tuple[UInt8Array, UInt8Array]]


def coplanar_pieces(charts: Charts, chart: int, margin: float) -> Int64Array:
    """Find the other pieces of a chart's surface in its plane within a margin.

    Parameters
    ----------
    charts : all charts.
    chart : row of the chart.
    margin : metres.

    Returns
    -------
    (k,) chart rows.
    """
    # in the chart's frame a rotated piece extends farther, by its diagonal at most
    others = charts.charts_within(chart, 2 * margin + charts.max_diagonal + MAX_PLANE_GAP_M)
    others = others[(charts.surface[others] == charts.surface[chart]) & (others != chart)]
    if len(others) == 0:
        return np.zeros(0, np.int64)
    normal = charts.normals()
    corners = charts.points_at_shares(others, CORNER_SHARES) - charts.origin[chart]
    x, y = corners @ charts.axis_u[chart], corners @ charts.axis_v[chart]
    width, height = charts.size[chart]
    near = (x.max(axis=1) > -margin) & (x.min(axis=1) < width + margin)
    near &= (y.max(axis=1) > -margin) & (y.min(axis=1) < height + margin)
    near &= np.abs(corners @ normal[chart]).min(axis=1) < MAX_PLANE_GAP_M
    near &= normal[others] @ normal[chart] > MIN_COPLANAR_COSINE
    pieces: Int64Array = others[near]
    return pieces


def read_chart_with_surroundings(
    charts: Charts, density: Float64Array, chart: int, size: tuple[int, int], margin: int, read: ChartReader
) -> tuple[UInt8Array, UInt8Array]:
    """Read colour and provenance of a chart with a margin filled from pieces of its surface.

    Parameters
    ----------
    charts : all n charts.
    density : (n,) texels per metre.
    chart : row of the chart.
    size : height h and width w of the chart, texels.
    margin : m, texels.
    read : reads part of a chart.

    Returns
    -------
    Colour (h + 2 m, w + 2 m, 3) and provenance (h + 2 m, w + 2 m); 0 outside all pieces.
    """
    height, width = size
    rows, columns = height + 2 * margin, width + 2 * margin
    colour, provenance = np.zeros((rows, columns, 3), np.uint8), np.zeros((rows, columns), np.uint8)
    for other in coplanar_pieces(charts, chart, margin / density[chart]).tolist():
        # texel (x, y) of the chart with its margin is texel turn @ (x, y) + move of the other piece
        axes = np.stack([charts.axis_u[other], charts.axis_v[other]])
        finer = density[other] / density[chart]
        turn = finer * (axes @ np.stack([charts.axis_u[chart], charts.axis_v[chart]], axis=1))
        offset = axes @ (charts.origin[chart] - charts.origin[other])
        move = offset * density[other] + turn @ np.full(2, 0.5 - margin) - 0.5
        extent = raster_sizes(charts.size[other : other + 1], density[other])[0]
        ends = CORNER_SHARES * (extent - 1)
        back = (ends - move) @ np.linalg.inv(turn).T
        x0, y0 = np.maximum(np.floor(back.min(axis=0)) - 1, 0).astype(int)
        x1, y1 = np.minimum(np.ceil(back.max(axis=0)) + 2, (columns, rows)).astype(int)
        if x0 >= x1 or y0 >= y1:
            continue
        grid = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1)
        texels = np.floor(grid @ turn.T + move + 0.5).astype(np.int64)
        # grids of pieces differ: a texel may fall between two pieces, into the gutter
        gap = int(np.ceil(finer))
        inside = ((texels >= -gap) & (texels <= extent + gap - 1)).all(axis=2)
        if not inside.any():
            continue
        texels = np.clip(texels, 0, extent - 1)
        low, high = texels[inside].min(axis=0), texels[inside].max(axis=0) + 1
        piece_colour, piece_provenance = read(other, slice(low[1], high[1]), slice(low[0], high[0]))
        column, row = (texels[inside] - low).T
        colour[y0:y1, x0:x1][inside] = piece_colour[row, column]
        provenance[y0:y1, x0:x1][inside] = piece_provenance[row, column]
    interior = (slice(margin, margin + height), slice(margin, margin + width))
    colour[interior], provenance[interior] = read(chart, slice(0, height), slice(0, width))
    return colour, provenance
