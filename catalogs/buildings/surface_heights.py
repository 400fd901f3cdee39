"""Heights of buildings measured on rasters of the surface, such as LiDAR, and of the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from catalogs.buildings.settings import SITES
from catalogs.printable_text import format_count
from facade_core.core.arrays import Float64Array
from facade_core.core.types import Building, ElevationRaster


def measure_assumed_heights(
    buildings: Sequence[Building], surface: ElevationRaster, ground: ElevationRaster, source: str
) -> tuple[tuple[Building, ...], tuple[str, ...]]:
    """Replace the assumed heights of buildings by those between the ground and the surface, less their roofs.

    Buildings that no cell shows, or that are lower than SITES.min_measured_height_m there, keep the assumed height.

    Parameters
    ----------
    buildings : buildings in the frame of the rasters.
    surface : highest points, roofs included.
    ground : the ground without buildings.
    source : name of the surface's file, for the notes.

    Returns
    -------
    All buildings, and notes.
    """
    found: list[Building] = []
    notes = []
    measured = low = unseen = 0
    for building in buildings:
        if building.height_source == "default" and not building.raised:
            top = _height_above_ground(building.footprint, surface, ground)
            if top is None:
                unseen += 1
            elif top < SITES.min_measured_height_m:
                low += 1
            else:
                measured += 1
                building = _with_top(building, top)
        found.append(building)
    if measured:
        notes.append(f"heights of {format_count(measured, 'building')} measured on {source} instead of assumed")
    if low:
        notes.append(
            f"{format_count(low, 'building')} under {SITES.min_measured_height_m:g} m on {source}, which keep the "
            "assumed height"
        )
    if unseen:
        notes.append(f"{format_count(unseen, 'building')} without heights on {source}, which keep the assumed height")
    return tuple(found), tuple(notes)


def _with_top(building: Building, top: float) -> Building:
    """Return a building that is so high with its roof; a roof that leaves no wall is laid flat."""
    roof = building.roof
    if roof is not None and top - roof.height < SITES.min_measured_height_m:
        roof = replace(roof, shape="flat", height=0.0)
    walls = top - (0.0 if roof is None else roof.height)
    return replace(building, height=round(walls, 2), height_source="height", roof=roof)


def _height_above_ground(footprint: Polygon, surface: ElevationRaster, ground: ElevationRaster) -> float | None:
    """Return the height of a roof's top above the median ground under it, in metres; None where too few cells show it."""
    inner = footprint.buffer(-surface.step)  # the cells at walls average roof and ground
    roof = heights_within(footprint if inner.is_empty else inner, surface)
    if len(roof) < SITES.min_roof_cells:
        return None
    foot = heights_within(footprint, ground)
    if not len(foot):
        foot = _nearest_height(footprint, ground)
    return float(np.quantile(roof, SITES.roof_top_quantile) - np.median(foot)) if len(foot) else None


def heights_within(outline: BaseGeometry, raster: ElevationRaster) -> Float64Array:
    """Return the known heights (k,) of the cells whose centres are in an outline."""
    if outline.is_empty:
        return np.empty(0)
    rows, columns = raster.heights.shape
    west, south, east, north = outline.bounds
    first = np.clip(np.ceil((west - raster.x) / raster.step), 0, columns).astype(int)
    last = np.clip(np.floor((east - raster.x) / raster.step) + 1, 0, columns).astype(int)
    top = np.clip(np.ceil((raster.y - north) / raster.step), 0, rows).astype(int)
    bottom = np.clip(np.floor((raster.y - south) / raster.step) + 1, 0, rows).astype(int)
    x, y = np.meshgrid(raster.x + raster.step * np.arange(first, last), raster.y - raster.step * np.arange(top, bottom))
    heights = raster.heights[top:bottom, first:last][shapely.contains_xy(outline, x, y)]
    known: Float64Array = heights[np.isfinite(heights)].astype(np.float64)
    return known


def _nearest_height(footprint: Polygon, raster: ElevationRaster) -> Float64Array:
    """Return the height (1,) of the cell nearest to the middle of a footprint smaller than cells; (0,) where unknown."""
    place = footprint.representative_point()
    column, row = round((place.x - raster.x) / raster.step), round((raster.y - place.y) / raster.step)
    rows, columns = raster.heights.shape
    if not (0 <= row < rows and 0 <= column < columns) or not np.isfinite(raster.heights[row, column]):
        return np.zeros(0)
    return np.array([float(raster.heights[row, column])])
