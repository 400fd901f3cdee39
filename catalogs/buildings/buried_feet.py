"""Buildings that begin below their ground, as sources do that extend walls to height 0."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from catalogs.buildings.settings import SITES
from catalogs.buildings.surface_heights import heights_within
from catalogs.features import format_reason_notes
from facade_core.core.types import Building, ElevationRaster


def cut_buried_feet(
    buildings: Sequence[Building], elevation: ElevationRaster | None
) -> tuple[tuple[Building, ...], tuple[str, ...]]:
    """Cut extruded buildings off at the lowest ground around them; their roofs stay.

    Floors would be counted from below the ground. Parts of a building have one foot and are cut together. Buildings that
    begin above the ground or have passages stay, and so do models, which are cut as they are built.

    Parameters
    ----------
    buildings : buildings of a block.
    elevation : raster of its ground; without one no building is cut.

    Returns
    -------
    buildings : the same, cut.
    notes : remarks for the user.
    """
    if elevation is None:
        return tuple(buildings), ()
    parts: dict[str, list[Building]] = defaultdict(list)
    for building in buildings:
        parts[building.whole_id].append(building)
    feet = {whole: _find_buried_foot(members, elevation) for whole, members in parts.items()}
    cut = [feet[building.whole_id] for building in buildings]
    reason = "buildings that begin below their ground cut off at it"
    return (
        tuple(
            building
            if lowest is None or building.base is None
            else replace(building, base=lowest, height=building.height - (lowest - building.base))
            for building, lowest in zip(buildings, cut, strict=True)
        ),
        format_reason_notes(
            {reason: [one.id for one, lowest in zip(buildings, cut, strict=True) if lowest is not None]}
        ),
    )


def _find_buried_foot(members: Sequence[Building], elevation: ElevationRaster) -> float | None:
    """Return the lowest ground around the parts of a building, None unless all of them begin below it."""
    if any(member.shell is not None or member.raised or member.passages for member in members):
        return None
    lowest = min(_lowest_ground(member, elevation) for member in members)
    return lowest if all(_is_buried(member, lowest) for member in members) else None


def _lowest_ground(building: Building, elevation: ElevationRaster) -> float:
    """Return the lowest height of the raster at a building; -inf where it states none."""
    heights = heights_within(building.footprint.buffer(elevation.step), elevation)
    return float(heights.min()) if len(heights) else -math.inf


def _is_buried(building: Building, lowest: float) -> bool:
    if building.base is None:
        return False
    depth = lowest - building.base
    return depth >= SITES.min_buried_m and building.height - depth >= SITES.min_visible_m
