"""Doors of walls off the streets: narrow walls at corners, and back walls."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.charts import Charts
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.geometry.walls import WallRole
from facade_core.plan.facades import Facades
from facade_core.plan.settings import DOORS

# Left and right end of a wall's foot, as shares of its chart.
_FOOT_SHARES = np.array([[0.0, 1.0], [1.0, 1.0]])


def is_corner_facade(charts: Charts, facades: Facades, facade: int) -> bool:
    """Return whether a facade is a narrow wall that cuts off the corner of two streets."""
    if (
        facades.role[facade] != WallRole.SIDE
        or facades.raised[facade]
        or abs(facades.foot[facade]) > FACADE_WALLS.level_tolerance_m
    ):
        return False
    own = facades.run_members(facade)
    others = facades.building_facades(facade)
    others = others[facades.role[others] == WallRole.STREET]
    foot, ends = (charts.points_at_shares(facades.chart[some], _FOOT_SHARES)[..., :2] for some in (others, own))
    normals = charts.normals()[facades.chart[others]]
    along = (ends[-1, 1] - ends[0, 0]) / np.hypot(*(ends[-1, 1] - ends[0, 0]))
    found = []
    # the left wall must end where this one begins, and face away from the right one: else the corner is a nook
    for one, place, end, way in ((own[0], ends[0, 0], 1, -1), (own[-1], ends[-1, 1], 0, 1)):
        turn = (normals * charts.normals()[facades.chart[one]]).sum(axis=1)
        turned = (
            (turn > DOORS.corner_cosines[0])
            & (turn < DOORS.corner_cosines[1])
            & (way * (normals[:, :2] * along).sum(axis=1) > 0)
        )
        found.append(bool((turned & (np.hypot(*(foot[:, end] - place).T) < FACADE_WALLS.corner_tolerance_m)).any()))
    return all(found)


def has_back_door(facades: Facades, facade: int) -> bool:
    """Return whether a back wall has a door: the widest on the ground, or the two widest of many."""
    if facades.role[facade] != WallRole.BACK:
        return False
    own = facades.building_facades(facade)
    backs = own[
        (facades.role[own] == WallRole.BACK)
        & (np.abs(facades.foot[own]) < FACADE_WALLS.level_tolerance_m)
        & ~facades.raised[own]
    ]
    runs = np.unique(facades.run[backs])
    wide = np.array(
        [(facades.along[one] + facades.width[one]).max() for one in map(facades.run_members, runs.tolist())]
    )
    order = np.argsort(-wide, kind="stable")
    chosen = runs[order][: 2 if len(runs) >= DOORS.min_backs_for_two_doors else 1]
    return bool(facades.run[facade] in chosen[wide[order][: len(chosen)] >= DOORS.min_door_wall_m])
