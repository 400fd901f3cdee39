"""The panoramas that surfaces are taken from: their refined poses, one exposure for all, and which are near a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from catalogs.block import Block
from facade_core.atlas.journal import Record
from facade_core.atlas.posed import read_posed
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.cameras.exposure import factors
from facade_core.plan import Plan
from tasks.kinds.poses import refined
from tasks.units.imagery import Taken

# Panoramas at most that a surface is taken from, the nearest to its middle: with pieces of ground of 32 m and a panorama each
# five metres all that see it from a street.
CAMERAS = 8


@dataclass(frozen=True)
class Cameras:
    """The usable panoramas of a block, and their places as a tree."""

    taken: tuple[Taken, ...]
    places: shapely.STRtree

    def near(self, corners: np.ndarray, reach: float) -> tuple[Taken, ...]:
        """Those within `reach` metres of the box, seen from above, of some corners (k, 2), at most CAMERAS, in their order."""
        low, high = corners.min(axis=0), corners.max(axis=0)
        found = self.places.query(shapely.box(*low, *high), predicate="dwithin", distance=reach)
        middle = (low + high) / 2

        def away(i: int) -> tuple[float, int]:
            pose = self.taken[i].pose
            return float(np.hypot(pose.x - middle[0], pose.y - middle[1])), i

        return tuple(self.taken[i] for i in sorted(sorted(found.tolist(), key=away)[:CAMERAS]))


def cameras_of_block(block: Block, plan: Plan, group: StoreGroup, usable: Callable[[Record | None], bool]) -> Cameras:
    """As the journal stands: poses that are refined, and what their pictures show of the ground; those that are usable by their
    record."""
    records = read_posed(group)
    squares = [_squares(record) for record in records]
    gains = factors(squares)
    taken = tuple(
        Taken(panorama.path, refined(pose, record), tuple(gain), own)
        for panorama, pose, record, gain, own in zip(
            block.panoramas, plan.poses, records, gains.tolist(), squares, strict=True
        )
        if usable(record)
    )
    return Cameras(
        taken, shapely.STRtree(shapely.points(np.array([(t.pose.x, t.pose.y) for t in taken]).reshape(-1, 2)))
    )


def _squares(record: Record | None) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(square) for square in record.get("squares", ())) if record else ()
