"""Which walls one enters by beside the fronts: those that turn a corner between two, and backs."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.charts import Charts
from facade_core.geometry.walls import BACK, LEVEL_M, MEETING_M, SIDE, STREET
from facade_core.plan.facades import Facades

# Where a wall begins and ends at its foot, as shares of its chart.
_FOOT = np.array([[0.0, 1.0], [1.0, 1.0]])
# A narrow wall turns a corner where both walls beside it are turned from it by 15 to 75 degrees (cosines).
TURNED = (0.26, 0.966)
# A back narrower than this has no door.
DOOR_WALL_M = 1.6
# Of a building's backs so many have one: the widest, and one more where there are at least so many.
MANY_BACKS = 5


def turns_corner(charts: Charts, facades: Facades, facade: int) -> bool:
    """Whether a facade is a narrow wall, in sight, on the ground, that cuts off the corner between two of its building on
    streets."""
    if facades.role[facade] != SIDE or facades.raised[facade] or abs(facades.foot[facade]) > LEVEL_M:
        return False
    own = facades.laid_out_with(facade)
    others = facades.of_building(facade)
    others = others[facades.role[others] == STREET]
    foot, ends = (charts.at_shares(facades.chart[some], _FOOT)[..., :2] for some in (others, own))
    normals = charts.normal()[facades.chart[others]]
    along = (ends[-1, 1] - ends[0, 0]) / np.hypot(*(ends[-1, 1] - ends[0, 0]))
    found = []
    # what is on its left ends where it begins, and faces away from its right: the corner is no nook
    for one, place, end, way in ((own[0], ends[0, 0], 1, -1), (own[-1], ends[-1, 1], 0, 1)):
        turn = normals @ charts.normal()[facades.chart[one]]
        turned = (turn > TURNED[0]) & (turn < TURNED[1]) & (way * (normals[:, :2] @ along) > 0)
        found.append(bool((turned & (np.hypot(*(foot[:, end] - place).T) < MEETING_M)).any()))
    return all(found)


def has_back_door(facades: Facades, facade: int) -> bool:
    """Whether a building is entered by a back: by the widest that stands on the ground, or one more of many."""
    if facades.role[facade] != BACK:
        return False
    own = facades.of_building(facade)
    backs = own[(facades.role[own] == BACK) & (np.abs(facades.foot[own]) < LEVEL_M) & ~facades.raised[own]]
    runs = np.unique(facades.run[backs])
    wide = np.array(
        [(facades.along[one] + facades.width[one]).max() for one in map(facades.laid_out_with, runs.tolist())]
    )
    order = np.argsort(-wide, kind="stable")
    chosen = runs[order][: 2 if len(runs) >= MANY_BACKS else 1]
    return bool(facades.run[facade] in chosen[wide[order][: len(chosen)] >= DOOR_WALL_M])
