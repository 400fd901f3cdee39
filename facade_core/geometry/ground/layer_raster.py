"""Rasters of the mapped ground layers: carriageways, pavements, paths and areas by surface."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.core.arrays import UInt8Array
from facade_core.geometry.charts import Charts
from facade_core.geometry.ground.layers import ground_layers, join_carriageways
from facade_core.geometry.ground.shapes import GroundTileShapes

# Binary fraction digits of a texel to which outlines are drawn.
SUBPIXEL_BITS = 4


def rasterise_ground_layers(
    charts: Charts, chart: int, tile: GroundTileShapes, density: float, size: tuple[int, int], margin: int
) -> UInt8Array:
    """Draw the ground layers of a chart.

    Parameters
    ----------
    chart : index of the chart.
    tile : ground tile of the chart.
    density : texels per metre.
    size : (height, width) of the chart in texels.
    margin : texels around the chart.

    Returns
    -------
    (height + 2 margin, width + 2 margin) uppermost layer plus one, 0 without any.
    """
    import cv2

    kinds = np.zeros((size[0] + 2 * margin, size[1] + 2 * margin), np.uint8)
    roads = [way for way in tile.ways if way.kind == "road"]
    # on sloping ground, shapes keep their map coordinates
    frame = np.linalg.inv(np.column_stack([charts.axis_u[chart, :2], charts.axis_v[chart, :2]]))
    for layer, shape in ground_layers(tile.areas, tile.ways, join_carriageways(roads)[0]).items():
        rings = shapely.get_rings(shapely.get_parts(shape))
        texels = [
            (shapely.get_coordinates(ring) - charts.origin[chart, :2]) @ frame.T * density + margin - 0.5
            for ring in rings
        ]
        if texels:
            cv2.fillPoly(
                kinds,
                [np.rint(one * 2**SUBPIXEL_BITS).astype(np.int32) for one in texels],
                layer + 1,
                shift=SUBPIXEL_BITS,
            )
    return kinds
