"""The height of the ground: a raster, or interpolated from what the buildings stand on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.types import Building, Elevation

# The raster made from the buildings' bases: its finest step, its largest number of cells, how far it reaches around them.
STEP_M = 2.0
CELLS = 1_000_000
MARGIN_M = 40.0
# Coordinates are taken relative to a place on a grid of this step.
NEAR_M = 1000.0
# Steps between neighbouring bases are smoothed over about this distance.
SMOOTH_M = 5.0
# A base is taken for wrong when it is this far from the median of its neighbours', and farther than they usually are.
NEIGHBOURS = 8
WILD_M = 2.0
WILD_SPREADS = 4.0
# Outlines are looked at this often.
SAMPLE_M = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """Ground heights on a raster: bilinear between cell centres, the nearest outside.

    x, y: the centre of the first (south-western) cell; step in metres; heights (rows, columns) float64 metres, row 0 south.
    One cell is level ground.
    """

    x: float
    y: float
    step: float
    heights: np.ndarray

    @property
    def level(self) -> bool:
        """Whether the ground has one height."""
        return self.heights.size == 1

    def height(self, points: np.ndarray) -> np.ndarray:
        """Ground height (n,) at points (n, 2), metres."""
        rows, columns = self.heights.shape
        u = np.clip((points[:, 0] - self.x) / self.step, 0, columns - 1)
        v = np.clip((points[:, 1] - self.y) / self.step, 0, rows - 1)
        i, j = u.astype(np.int64), v.astype(np.int64)
        right, up = np.minimum(i + 1, columns - 1), np.minimum(j + 1, rows - 1)
        fu, fv = u - i, v - j
        # from one value towards the other, so that equal ones stay exactly what they are
        south = self.heights[j, i] + fu * (self.heights[j, right] - self.heights[j, i])
        north = self.heights[up, i] + fu * (self.heights[up, right] - self.heights[up, i])
        return south + fv * (north - south)

    def lowest(self, outline: Polygon) -> float:
        """The lowest ground along an outline, metres."""
        return float(self.height(shapely.get_coordinates(outline.segmentize(SAMPLE_M))).min())


def base_of(building: Building) -> float | None:
    """Height of the ground at a building as its source has it: stated, or the lowest point of its model; None without."""
    if building.base is not None:
        return building.base
    if building.shell is not None and len(building.shell.triangles):
        return float(building.shell.vertices[building.shell.triangles, 2].min())
    return None


def terrain_of(buildings: Sequence[Building], elevation: Elevation | None) -> Terrain:
    """The ground under a block: of a raster where there is one, else of the buildings' bases, else level at 0.

    Cells without a height take the nearest one's; a raster without any does not count. A base far from its neighbours' is
    replaced by their median. Equal bases give exactly level ground.
    """
    if elevation is not None and np.isfinite(elevation.heights).any():
        return _of_raster(elevation)
    bases = [
        (building, base) for building in buildings if (base := base_of(building)) is not None and np.isfinite(base)
    ]
    heights = np.array([base for _, base in bases])
    if len(bases) == 0 or np.ptp(heights) == 0:
        return Terrain(0.0, 0.0, 1.0, np.full((1, 1), heights[0] if len(bases) else 0.0))
    return _of_bases([building.footprint for building, _ in bases], heights)


def _of_raster(elevation: Elevation) -> Terrain:
    from scipy.ndimage import distance_transform_edt

    heights = np.asarray(elevation.heights, np.float64)
    unknown = ~np.isfinite(heights)
    if unknown.any():
        row, column = distance_transform_edt(unknown, return_distances=False, return_indices=True)
        heights = heights[row, column]
    if np.ptp(heights) == 0:
        return Terrain(0.0, 0.0, 1.0, heights[:1, :1])
    south = elevation.y - (len(heights) - 1) * elevation.step
    return Terrain(elevation.x, south, elevation.step, heights[::-1])


def _of_bases(outlines: Sequence[Polygon], bases: np.ndarray) -> Terrain:
    """A triangulation of the outlines' corners at their bases, on a raster, smoothed."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.ndimage import gaussian_filter
    from scipy.spatial import cKDTree

    middles = shapely.get_coordinates(shapely.centroid(np.asarray(outlines, object)))
    bases = _tamed(middles, bases)
    if np.ptp(bases) == 0:
        return Terrain(0.0, 0.0, 1.0, bases[:1, None])
    corners, owner = shapely.get_coordinates(np.asarray(outlines, object), return_index=True)
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    step = max(STEP_M, float(np.sqrt(np.prod(high - low) / CELLS)))
    # on a grid and to the millimetre: the ground stays as it is when something is built elsewhere
    low = np.floor(low / step) * step
    columns, rows = np.ceil((high - low) / step).astype(int) + 1
    # one point for each cell of the raster that has corners
    _, of, corners_in = np.unique(
        np.round((corners - low) / step) @ [1, columns], return_inverse=True, return_counts=True
    )
    points = np.stack([np.bincount(of, corners[:, k] - low[k]) for k in range(2)], axis=1) / corners_in[:, None] + low
    heights = np.bincount(of, bases[owner]) / corners_in
    at = np.stack(np.meshgrid(low[0] + step * np.arange(columns), low[1] + step * np.arange(rows)), axis=-1).reshape(
        -1, 2
    )
    # relative to a place near: the triangulation works to a share of the coordinates' size
    centre = np.round(points.mean(axis=0) / NEAR_M) * NEAR_M
    raster = np.round(LinearNDInterpolator(points - centre, heights)(at - centre), 3)
    outside = ~np.isfinite(raster)
    raster[outside] = heights[cKDTree(points).query(at[outside])[1]]
    smooth = gaussian_filter(raster.reshape(rows, columns), SMOOTH_M / step, mode="nearest")
    return Terrain(float(low[0]), float(low[1]), step, smooth)


def _tamed(middles: np.ndarray, bases: np.ndarray) -> np.ndarray:
    """Bases (n,) with those far from the bases around replaced by their median."""
    from scipy.spatial import cKDTree

    if len(bases) < 4:
        return bases
    near = cKDTree(middles).query(middles, k=min(NEIGHBOURS + 1, len(bases)))[1]
    others = np.where(near == np.arange(len(bases))[:, None], np.nan, bases[near])
    median = np.nanmedian(others, axis=1)
    spread = np.nanmedian(np.abs(others - median[:, None]), axis=1)
    wild = np.abs(bases - median) > WILD_M + WILD_SPREADS * spread
    return np.where(wild, median, bases)
