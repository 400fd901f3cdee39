"""Ground heights from a raster, or interpolated from the bases of buildings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Building, ElevationRaster
from facade_core.geometry.ground.settings import TERRAIN


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """Raster of ground heights: bilinear between cell centres, nearest outside.

    Attributes
    ----------
    x, y : centre of the first (south-western) cell.
    step : metres between cells.
    heights : (rows, columns) metres, row 0 south; one cell is level ground.
    """

    x: float
    y: float
    step: float
    heights: Float64Array

    @property
    def is_level(self) -> bool:
        """Return whether the ground has one height."""
        return self.heights.size == 1

    def interpolate(self, points: Float64Array) -> Float64Array:
        """Return the ground heights (n,) in metres at points (n, 2)."""
        rows, columns = self.heights.shape
        u = np.clip((points[:, 0] - self.x) / self.step, 0, columns - 1)
        v = np.clip((points[:, 1] - self.y) / self.step, 0, rows - 1)
        i, j = u.astype(np.int64), v.astype(np.int64)
        right, up = np.minimum(i + 1, columns - 1), np.minimum(j + 1, rows - 1)
        fu, fv = u - i, v - j
        # interpolation by differences keeps equal heights exact
        south = self.heights[j, i] + fu * (self.heights[j, right] - self.heights[j, i])
        north = self.heights[up, i] + fu * (self.heights[up, right] - self.heights[up, i])
        height: Float64Array = south + fv * (north - south)
        return height

    def lowest_along(self, outline: Polygon) -> float:
        """Return the lowest ground along an outline in metres."""
        return float(self.interpolate(shapely.get_coordinates(outline.segmentize(TERRAIN.outline_sampling_m))).min())


def source_ground_height(building: Building) -> float | None:
    """Return the ground height at a building by its source: stated, or the lowest point of its model; None without."""
    if building.base is not None:
        return building.base
    if building.shell is not None and len(building.shell.triangles):
        return float(building.shell.vertices[building.shell.triangles, 2].min())
    return None


def build_terrain(buildings: Sequence[Building], elevation: ElevationRaster | None) -> Terrain:
    """Build the terrain of a block from a raster, else from the buildings' bases, else level at 0.

    Unknown cells take the nearest height. Outlier bases are replaced by the median of their neighbours. Equal bases
    give exactly level ground.

    Parameters
    ----------
    elevation : raster of ground heights; ignored where all of it is unknown.
    """
    if elevation is not None and np.isfinite(elevation.heights).any():
        return _terrain_from_raster(elevation)
    bases = [
        (building, base)
        for building in buildings
        if (base := source_ground_height(building)) is not None and np.isfinite(base)
    ]
    heights = np.array([base for _, base in bases])
    if len(bases) == 0 or np.ptp(heights) == 0:
        return Terrain(0.0, 0.0, 1.0, np.full((1, 1), heights[0] if len(bases) else 0.0))
    return _terrain_from_bases([building.footprint for building, _ in bases], heights)


def _terrain_from_raster(elevation: ElevationRaster) -> Terrain:
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


def _terrain_from_bases(outlines: Sequence[Polygon], bases: Float64Array) -> Terrain:
    """Triangulate the outlines' corners at their bases, rasterise and smooth."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.ndimage import gaussian_filter
    from scipy.spatial import cKDTree

    middles = shapely.get_coordinates(shapely.centroid(np.asarray(outlines, object)))
    bases = _replace_outliers(middles, bases)
    if np.ptp(bases) == 0:
        return Terrain(0.0, 0.0, 1.0, bases[:1, None])
    corners, owner = shapely.get_coordinates(np.asarray(outlines, object), return_index=True)
    low, high = corners.min(axis=0) - TERRAIN.raster_margin_m, corners.max(axis=0) + TERRAIN.raster_margin_m
    step = max(TERRAIN.min_raster_step_m, float(np.sqrt(np.prod(high - low) / TERRAIN.max_raster_cells)))
    # on a grid and rounded to millimetres, so that the ground does not move when the block changes elsewhere
    low = np.floor(low / step) * step
    columns, rows = np.ceil((high - low) / step).astype(int) + 1
    # one point per raster cell with corners
    _, of, corners_in = np.unique(
        np.round((corners - low) / step) @ [1, columns], return_inverse=True, return_counts=True
    )
    points = np.stack([np.bincount(of, corners[:, k] - low[k]) for k in range(2)], axis=1) / corners_in[:, None] + low
    heights = np.bincount(of, bases[owner]) / corners_in
    at = np.stack(np.meshgrid(low[0] + step * np.arange(columns), low[1] + step * np.arange(rows)), axis=-1).reshape(
        -1, 2
    )
    # relative to a near origin: the precision of the triangulation depends on the size of the coordinates
    centre = np.round(points.mean(axis=0) / TERRAIN.local_origin_grid_m) * TERRAIN.local_origin_grid_m
    raster = np.round(LinearNDInterpolator(points - centre, heights)(at - centre), 3)
    outside = ~np.isfinite(raster)
    raster[outside] = heights[cKDTree(points).query(at[outside])[1]]
    smooth = gaussian_filter(raster.reshape(rows, columns), TERRAIN.smooth_m / step, mode="nearest")
    return Terrain(float(low[0]), float(low[1]), step, smooth)


def _replace_outliers(middles: Float64Array, bases: Float64Array) -> Float64Array:
    """Replace outliers among bases (n,) by the median of their neighbours."""
    from scipy.spatial import cKDTree

    if len(bases) < 4:
        return bases
    near = cKDTree(middles).query(middles, k=min(TERRAIN.outlier_neighbours + 1, len(bases)))[1]
    others = np.where(near == np.arange(len(bases))[:, None], np.nan, bases[near])
    median = np.nanmedian(others, axis=1)
    spread = np.nanmedian(np.abs(others - median[:, None]), axis=1)
    wild = np.abs(bases - median) > TERRAIN.min_outlier_m + TERRAIN.min_outlier_spreads * spread
    return np.where(wild, median, bases)
