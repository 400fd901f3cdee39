"""Doubts about an elevation model: parts without heights, roofs in it, and another datum than that of the buildings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.buildings.surface_heights import heights_within
from catalogs.printable_text import format_count
from catalogs.readers.pictures.elevation import read_elevation
from facade_core.core.errors import InputError
from facade_core.core.types import Building, ElevationRaster

if TYPE_CHECKING:
    from pyproj import CRS

    from catalogs.buildings.extents import Bounds

_RING_M = (3.0, 8.0)  # around a building, where its ground is seen
_MAX_SAMPLE = 200  # buildings
_MIN_BUMP_M = 2.0
_MIN_BUMP_SHARE = 0.5  # of the buildings
_MIN_DATUM_GAP_M = 3.0
_MAX_DATUM_SPREAD_M = 2.0
_MIN_ZERO_SHARE = 0.002  # of the cells
_MAX_MIXED_SHARE = 0.35  # cells between 0 and heights, of those with 0
_MAX_CELL_M = 5.0  # larger cells do not show a roof
_MAX_STEEP_SHARE = 0.25
_STEEP = 1.5  # metres a metre
# Suffixes of rasters of heights; pictures have others too.
_SUFFIXES = frozenset((".tif", ".tiff", ".asc", ".img", ".jp2", ".dt0", ".dt1", ".dt2", ".hgt", ".vrt"))


def find_terrain(folders: Iterable[Path], crs: CRS, buildings: Sequence[Building], extent: Bounds) -> Path | None:
    """Find the raster in some folders that has the ground of a block, without roofs: of several, the finest.

    Pictures, rasters of other places and all that `note_terrain_doubts` doubts are left out.

    Parameters
    ----------
    crs : metric frame of the block.
    buildings : buildings of the block.
    extent : (xmin, ymin, xmax, ymax) around them.
    """
    found = []
    for path in sorted({path for folder in folders for path in folder.iterdir() if path.suffix.lower() in _SUFFIXES}):
        with suppress(InputError, OSError):
            terrain = read_elevation(path, crs, extent)
            if not note_terrain_doubts(terrain, buildings, path.name):
                found.append((terrain.step, path.name, path))
    return min(found)[2] if found else None


def note_terrain_doubts(terrain: ElevationRaster, buildings: Sequence[Building], name: str) -> tuple[str, ...]:
    """Return notes on an elevation model that does not fit the buildings, with the remedy.

    Parameters
    ----------
    terrain : heights in the frame of the block.
    buildings : buildings in it.
    name : name of the raster's file.
    """
    steps = np.abs(np.diff(terrain.heights, axis=1))
    steps = steps[np.isfinite(steps)]
    if len(steps) and float((steps > _STEEP * terrain.step).mean()) > _MAX_STEEP_SHARE:
        return (
            f"{name} is steeper than any ground nearly everywhere, as a picture is; give heights in metres as terrain",
        )
    inside = [heights_within(one.footprint.buffer(terrain.step), terrain) for one in buildings]
    unknown = sum(len(heights) == 0 for heights in inside)
    notes = []
    if unknown:
        notes.append(
            f"{name} states no height at {format_count(unknown, 'building')} of {len(buildings)}, whose ground is continued "
            "from the nearest heights; give a raster that covers the block"
        )
    notes += _note_zeros(terrain, name)
    if terrain.step <= _MAX_CELL_M:
        notes += _note_roofs(terrain, buildings, name)
    gaps = np.array(
        [
            float(np.median(heights)) - one.base
            for one, heights in zip(buildings, inside, strict=True)
            if len(heights) and one.base is not None and not one.raised
        ]
    )
    middle = float(np.median(gaps)) if len(gaps) else 0.0
    if abs(middle) > _MIN_DATUM_GAP_M and float(np.median(np.abs(gaps - middle))) < _MAX_DATUM_SPREAD_M:
        notes.append(
            f"the ground of {name} is {abs(middle):.1f} m {'above' if middle > 0 else 'below'} the lower ends of the "
            "buildings (median): heights of another datum or unit; move one of them (buildings.offset)"
        )
    return tuple(notes)


def _note_zeros(terrain: ElevationRaster, name: str) -> list[str]:
    """Return a note where heights of exactly 0 stand between others that are all far from it."""
    known = terrain.heights[np.isfinite(terrain.heights)]
    zeros = int((known == 0.0).sum())
    near = int((np.abs(known) < _MIN_DATUM_GAP_M).sum()) - zeros
    if not _MIN_ZERO_SHARE * len(known) <= zeros < len(known) / 2 or near > _MAX_MIXED_SHARE * zeros:
        return []
    return [
        f"{name} is 0 in {zeros / len(known):.1%} of its cells and over {_MIN_DATUM_GAP_M:g} m in the others, as where heights "
        f"are unknown; where they are, say so with gdal_edit.py -a_nodata 0 {name}"
    ]


def _note_roofs(terrain: ElevationRaster, buildings: Sequence[Building], name: str) -> list[str]:
    """Return a note where most buildings stand on bumps, as they do in a surface model."""
    outlines = np.array([one.footprint for one in buildings], dtype=object)
    tree = shapely.STRtree(outlines)
    bumps = []
    for outline in outlines[:: max(1, len(outlines) // _MAX_SAMPLE)]:
        ring = outline.buffer(_RING_M[1])
        near = shapely.union_all(outlines[tree.query(ring, predicate="dwithin", distance=_RING_M[0])])
        core = outline.buffer(-terrain.step)
        roof = heights_within(core, terrain)
        ground = heights_within(ring.difference(near.buffer(_RING_M[0])), terrain)
        if len(roof) and len(ground):
            bumps.append(float(np.median(roof) - np.median(ground)))
    raised = [bump for bump in bumps if bump > _MIN_BUMP_M]
    if len(raised) <= _MIN_BUMP_SHARE * len(bumps):
        return []
    return [
        f"{name} shows {len(raised)} of {format_count(len(bumps), 'building')} {np.median(raised):.1f} m above the ground "
        "around them, as a surface model with roofs does; give a model of the ground as terrain, and this one as "
        "buildings.heights"
    ]
