"""What kind of ground lies where, as a map draws it: carriageway, pavement, paths and areas by their surfaces."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.geometry.charts import Charts
from facade_core.geometry.ground.layers import carriageways, layers_of
from facade_core.geometry.ground.shapes import Piece

# Fractions of a texel to which outlines are drawn.
SHIFT = 4


def kinds_of(
    charts: Charts, chart: int, piece: Piece, density: float, size: tuple[int, int], margin: int
) -> np.ndarray:
    """Kinds (h + 2 m, w + 2 m) uint8 of a chart of size (h, w) texels and of m = `margin` texels around it: the uppermost layer
    there plus one, 0 without any. piece: what the chart's square is drawn of; density in texels per metre."""
    import cv2

    kinds = np.zeros((size[0] + 2 * margin, size[1] + 2 * margin), np.uint8)
    roads = [way for way in piece.ways if way.kind == "road"]
    # on sloping ground shapes are drawn as they lie on the map
    frame = np.linalg.inv(np.column_stack([charts.axis_u[chart, :2], charts.axis_v[chart, :2]]))
    for layer, shape in layers_of(piece.areas, piece.ways, carriageways(roads)[0]).items():
        rings = shapely.get_rings(shapely.get_parts(shape))
        texels = [
            (shapely.get_coordinates(ring) - charts.origin[chart, :2]) @ frame.T * density + margin - 0.5
            for ring in rings
        ]
        if texels:
            cv2.fillPoly(kinds, [np.rint(one * 2**SHIFT).astype(np.int32) for one in texels], layer + 1, shift=SHIFT)
    return kinds
