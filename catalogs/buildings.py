"""From outlines as a source states them to the buildings of a block: cut, projected, repaired, with a height each."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from catalogs.features import Footprint, Footprints, natural_order, notes_by_reason
from facade_core.types import Building

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

SMALLEST = 10.0  # m2; below this an outline is a kiosk, a mast or a slip of the mapper
FALLBACK_HEIGHT = 12.0  # m; where no building of the block has a height


def block_buildings(
    source: Footprints, crs: CRS, *, area: Polygon | None, storey: float
) -> tuple[tuple[Building, ...], tuple[str, ...]]:
    """Buildings in the metric frame, ordered by id, and notes on what was set aside or assumed.

    area: polygon in the frame; a building is in if its representative point is. A MultiPolygon becomes one building per
    part, id-0, id-1, ..., from west to east. Height: the stated one, else levels x storey (roof levels lie behind the eaves and
    do not count), else the median of the known heights, else FALLBACK_HEIGHT.
    """
    reasons: dict[str, list[str]] = defaultdict(list)
    remarked = _projected([remark.outline for remark in source.remarks], source.crs, crs)
    for remark, outline in zip(source.remarks, remarked, strict=True):
        if _touches(outline, area):
            reasons[remark.reason].append(remark.id)
    parts = []
    outlines = _projected([footprint.outline for footprint in source.items], source.crs, crs)
    for footprint, outline in zip(source.items, outlines, strict=True):
        found, small = _parts(outline)
        if not found and _touches(outline, area):
            reason = f"footprints under {SMALLEST:g} m2" if small else "footprints that enclose no area"
            reasons[f"{reason} set aside"].append(footprint.id)
        for index, part in enumerate(found):
            if area is None or area.contains(part.representative_point()):
                parts.append((footprint.id if len(found) == 1 else f"{footprint.id}-{index}", part, footprint))
    parts.sort(key=lambda entry: natural_order(entry[0]))

    known = [height for _, _, footprint in parts if (height := _height(footprint, storey)[0]) is not None]
    default = round(median(known), 2) if known else FALLBACK_HEIGHT
    buildings = []
    for id, part, footprint in parts:
        height, origin = _height(footprint, storey)
        levels = max(1, int(footprint.levels)) if footprint.levels else None
        buildings.append(Building(id, part, default if height is None else height, origin, levels, footprint.name))
    notes = notes_by_reason(reasons)
    if assumed := sum(building.height_source == "default" for building in buildings):
        origin = f"the median of the {len(known)} known" if known else "since none is known"
        notes += (f"{assumed} of {len(buildings)} buildings state no height: {default:g} m assumed, {origin}",)
    return tuple(buildings), notes


def _height(footprint: Footprint, storey: float) -> tuple[float | None, str]:
    if footprint.height is not None:
        return round(footprint.height, 2), "height"
    if footprint.levels is not None:
        return round(footprint.levels * storey, 2), "levels"
    return None, "default"


def _projected(outlines: Sequence[Any], source: str, crs: CRS) -> np.ndarray:
    from pyproj import Transformer

    to_frame = Transformer.from_crs(source, crs, always_xy=True)
    return shapely.transform(shapely.force_2d(np.array(outlines, dtype=object)), to_frame.transform, interleaved=False)


def _touches(outline: Any, area: Polygon | None) -> bool:
    """Whether an outline, however broken, reaches into the area; one without a place counts."""
    if area is None or outline is None or outline.is_empty:
        return True
    return bool(shapely.box(*outline.bounds).intersects(area))


def _parts(outline: Polygon) -> tuple[list[Polygon], list[Polygon]]:
    """The valid polygons of an outline, courtyards kept, from west to east: large enough ones, and too small ones."""
    if not np.isfinite(shapely.get_coordinates(outline)).all():
        return [], []
    if not outline.is_valid:
        outline = shapely.make_valid(outline, method="structure", keep_collapsed=False)
    polygons = [part for part in shapely.get_parts(outline) if part.geom_type == "Polygon" and part.area > 0]
    polygons = sorted(shapely.normalize(polygons), key=lambda part: part.bounds)
    return [p for p in polygons if p.area >= SMALLEST], [p for p in polygons if p.area < SMALLEST]
