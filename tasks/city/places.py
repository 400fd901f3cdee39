"""Place of a block in its city: the ground that it covers and its main streets, for maps and readable names."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import shapely

from catalogs.block.part import nearest_street_names
from catalogs.block.reader import Block
from facade_core.core.arrays import Float64Array
from facade_core.core.json_types import JsonObject

# Streets that name a block.
MAX_NAMING_STREETS = 2
# An outline passes the outermost points at this distance and is simplified by less, metres.
OUTLINE_MARGIN_M = 6.0


@dataclass(frozen=True)
class BlockPlace:
    """Place of a block.

    Attributes
    ----------
    crs : projected CRS of the outline, as its run states it.
    outline : corners [east, north] of the ring around its own buildings, whole metres; empty without a building.
    streets : names of the streets along which most of its own buildings stand, the first the longest row.
    """

    crs: str
    outline: tuple[tuple[float, float], ...] = ()
    streets: tuple[str, ...] = ()

    def to_json(self) -> JsonObject:
        """Return the place as JSON values."""
        return {"crs": self.crs, "outline": [list(corner) for corner in self.outline], "streets": list(self.streets)}

    @classmethod
    def from_json(cls, values: JsonObject) -> BlockPlace:
        """Return the place that `to_json` wrote."""
        return cls(values["crs"], tuple((x, y) for x, y in values["outline"]), tuple(values["streets"]))


def place_block(block: Block) -> BlockPlace:
    """Return the place of a block: of a part of a city, that of its own buildings."""
    own = set(block.part.buildings) if block.part else {building.id for building in block.buildings}
    buildings = [building for building in block.buildings if building.id in own]
    names = (
        block.part.front_streets[: len(block.part.buildings)]
        if block.part
        else nearest_street_names(buildings, block.streets)
    )
    corners = shapely.get_coordinates([building.footprint for building in buildings])
    return BlockPlace(block.crs.to_string(), ring_around(corners), main_streets(names))


def ring_around(points: Float64Array) -> tuple[tuple[float, float], ...]:
    """Return the corners of a simplified convex ring around points (n, 2); empty without a point."""
    if not len(points):
        return ()
    hull = shapely.convex_hull(shapely.MultiPoint(points)).simplify(OUTLINE_MARGIN_M / 2)
    ring = np.round(shapely.get_coordinates(hull.buffer(OUTLINE_MARGIN_M, join_style="mitre", mitre_limit=2.0))[:-1])
    return tuple((float(x), float(y)) for x, y in ring)


def main_streets(names: tuple[str, ...] | list[str]) -> tuple[str, ...]:
    """Return the most frequent names, at most MAX_NAMING_STREETS; equally frequent ones in alphabetical order."""
    counted = Counter(name for name in names if name)
    return tuple(sorted(counted, key=lambda name: (-counted[name], name))[:MAX_NAMING_STREETS])
