"""Rule by which a building keeps its exemplar: enough of its walls are as they were when it chose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.plan.exemplar_choice import ExemplarTargetWalls

# A wall is unchanged while its width and height differ by less, metres.
MAX_SIZE_CHANGE_M = 0.1
# A building keeps its choice while so much of the width of its walls is unchanged: a neighbour may hide or uncover some.
MIN_UNCHANGED_SHARE = 0.5


class Wall(NamedTuple):
    """Wall of a building as it was when its exemplar was chosen; metres."""

    width: float
    height: float
    floors: int
    has_shops: bool

    def is_unchanged(self, before: Sequence[Wall]) -> bool:
        """Return whether one of the earlier walls was the same."""
        return any(
            abs(self.width - one.width) < MAX_SIZE_CHANGE_M
            and abs(self.height - one.height) < MAX_SIZE_CHANGE_M
            and (self.floors, self.has_shops) == (one.floors, one.has_shops)
            for one in before
        )


def walls_by_building(walls: ExemplarTargetWalls) -> dict[int, tuple[Wall, ...]]:
    """Return the walls of each building, by its number."""
    found: dict[int, list[Wall]] = {}
    sizes = np.round(np.column_stack([walls.width, walls.height]), 2).tolist()
    facts = zip(walls.building.tolist(), sizes, walls.floors.tolist(), (walls.shops > 0).tolist(), strict=True)
    for building, (width, height), floors, has_shops in facts:
        found.setdefault(building, []).append(Wall(width, height, floors, has_shops))
    return {building: tuple(sorted(own)) for building, own in found.items()}


def keeps_choice(walls: Sequence[Wall], before: Sequence[Wall]) -> bool:
    """Return whether enough of the width of a building's walls is as it was when it chose."""
    unchanged = sum(wall.width for wall in walls if wall.is_unchanged(before))
    return bool(walls) and unchanged >= MIN_UNCHANGED_SHARE * sum(wall.width for wall in walls)
