"""Windows of the buildings around a block: one for each bay and storey, as rectangles in front of the wall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.surrounding_mesh import SurroundingMaterial, SurroundingMesh
from facade_core.core.types import Building
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.terrain import Terrain
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.geometry.walls import wall_outlines_and_free_parts
from facade_core.plan.settings import SURROUNDINGS

_WINDOWLESS_STYLES = ("warehouse",)
# Left or right, and top or bottom, of the corners.
_CORNERS = np.array([(0, 1), (0, 3), (2, 3), (2, 1)])


def build_windows(
    neighbours: Sequence[Building], owner: Int64Array, charts: Charts, mesh: Mesh, terrain: Terrain
) -> SurroundingMesh:
    """Build the windows of neighbours, where their walls have room and no other wall stands against them.

    Parameters
    ----------
    neighbours : buildings around the block.
    owner : (charts,) row of the building of each chart; -1 of ground.
    charts, mesh : their surfaces.
    terrain : ground heights.
    """
    has_windows = np.array([one.facade_style not in _WINDOWLESS_STYLES for one in neighbours])
    is_upright = (charts.kind == ChartKind.WALL) & (np.abs(charts.normals()[:, 2]) < 0.1)
    walls = np.flatnonzero(is_upright & (charts.size[:, 0] > SURROUNDINGS.bay_m / 2) & has_windows[owner])
    _, free = wall_outlines_and_free_parts(charts, mesh, walls)
    parts = [_place_windows(charts, wall, neighbours[owner[wall]], terrain) for wall in walls.tolist()]
    row = np.repeat(np.arange(len(walls)), [len(part) for part in parts])
    boxes = np.concatenate([*parts, np.zeros((0, 4))])
    is_free = shapely.covers(free[row], shapely.box(*boxes.T))
    boxes, wall = boxes[is_free], walls[row[is_free]]
    normal = np.repeat(charts.normals()[wall], len(_CORNERS), axis=0)
    corners = charts.points(wall[:, None], boxes[:, _CORNERS[:, 0]], boxes[:, _CORNERS[:, 1]])
    points = corners.reshape(-1, 3) + SURROUNDINGS.window_lift_m * normal
    tint = np.array(SURROUNDINGS.pane_colours, np.uint8)[[0, 1, 1, 0]]
    triangles = np.array([(0, 1, 2), (0, 2, 3)]) + len(_CORNERS) * np.arange(len(boxes))[:, None, None]
    return SurroundingMesh(
        points,
        normal,
        np.full(len(points), SurroundingMaterial.WINDOW, np.uint8),
        np.tile(tint, (len(boxes), 1)),
        np.zeros(len(points), np.int64),
        triangles.reshape(-1, 3).astype(np.int32),
    )


def _place_windows(charts: Charts, wall: int, building: Building, terrain: Terrain) -> Float64Array:
    """Return left, top, right and bottom (k, 4) of a wall's windows in its frame."""
    foot = terrain.lowest_along(building.footprint) if building.base is None else building.base
    foot, height = foot + building.raised, building.height - building.raised
    most = int(height / FACADE_WALLS.floor_height_m[0])
    storeys = min(building.levels or max(1, round(height / SURROUNDINGS.storey_m)), most)
    storey, columns = height / max(storeys, 1), max(1, int(charts.size[wall, 0] / SURROUNDINGS.bay_m))
    bay = charts.size[wall, 0] / columns
    left, top, right, bottom = SURROUNDINGS.window
    column, level = (axis.ravel() for axis in np.meshgrid(np.arange(columns), np.arange(storeys)))
    ceiling = charts.origin[wall, 2] - foot - (level + 1) * storey
    x0, x1 = (column + left) * bay, (column + right) * bay
    return np.stack([x0, ceiling + top * storey, x1, ceiling + bottom * storey], axis=1)
