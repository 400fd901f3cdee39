"""Metric frame of a block: the one that its file gives, else one that fits its buildings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.keys import BlockFileSettings
from catalogs.buildings.extents import Bounds, BuildingSource
from catalogs.crs import (
    LONLAT,
    check_block_crs,
    choose_block_crs,
    note_outside_area_of_use,
    parse_crs,
    parse_metric_crs,
    project_lonlat_box,
)

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon


def choose_frame(
    keys: BlockFileSettings, sources: Sequence[BuildingSource], bounds: Bounds | None, file: BlockFileErrorContext
) -> tuple[CRS, Polygon | None, tuple[str, ...]]:
    """Return the metric frame, the area in it, and notes about the choice."""
    west, south, east, north = keys.area or bounds or (0.0, 0.0, 0.0, 0.0)
    middle = (((west + east) / 2 + 180.0) % 360.0 - 180.0, (south + north) / 2)
    notes: tuple[str, ...] = ()
    if keys.crs:
        frame = file.call_reader("crs", parse_metric_crs, keys.crs)
        file.call_reader("crs", check_block_crs, frame, *middle)
    else:
        stated = sources[0].crs
        assert stated is not None, "sources have frames once they are read"
        frame = file.call_reader("crs", choose_block_crs, stated, *middle)
        notes = _frame_notes(frame, stated, keys.buildings.crs, *(middle if stated == LONLAT else ()))
        if (given := parse_crs(stated)) != frame:
            notes += note_outside_area_of_use(given, *middle)
    notes += note_outside_area_of_use(frame, *middle)
    return frame, project_lonlat_box(keys.area, frame) if keys.area else None, notes


def _frame_notes(frame: CRS, stated: str, given: str | None, *middle: float) -> tuple[str, ...]:
    """Return a note about the frame of the block; none if it is the frame given for the buildings.

    Parameters
    ----------
    frame : CRS of the block.
    stated : CRS of the buildings.
    given : the same where the block file gives it.
    middle : longitude and latitude of the block where its source counts in degrees, whose order it may have swapped.
    """
    shown, source = f"CRS of the block: {frame.to_string()} ({frame.name})", parse_crs(stated)
    if source == frame:
        return () if given else (f"{shown}, as the buildings state it",)
    if middle and not given:
        return (f"{shown}, as the buildings lie at longitude {middle[0]:.4f}, latitude {middle[1]:.4f}",)
    return (f"{shown}, as {source.to_string()} does not measure metres there",)
