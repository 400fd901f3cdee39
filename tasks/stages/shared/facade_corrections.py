"""Corrections of facades, matched by id or by place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.block.corrections import FACADE_CORRECTION_KINDS, Corrections
from catalogs.crs import LONLAT, coordinate_transform
from facade_core.core.types import FacadeCorrections
from facade_core.plan.plan import Plan

if TYPE_CHECKING:
    from pyproj import CRS

# A facade that has another id than when it was corrected is the one there whose middle is no farther off, metres, and whose
# width differs by no more than this share.
PLACE_M, ALIKE = 2.0, 0.2
# Where a wall begins and ends at its foot, as shares of its chart.
_FOOT_CORNERS = np.array([[0.0, 1.0], [1.0, 1.0]])


def match_corrections(
    plan: Plan, corrections: Corrections, crs: CRS | str
) -> tuple[dict[int, FacadeCorrections], list[str]]:
    """Return the corrections of each facade of a plan, by index, and the ids without a facade.

    A facade whose id changed is matched by its place and width.
    """
    said = corrections.rename_targets(map_changed_facade_ids(plan, corrections, crs)).select_kinds(
        FACADE_CORRECTION_KINDS
    )
    at = {name: index for index, name in enumerate(plan.facades.id)}
    found = {
        at[id]: FacadeCorrections(**{what: one.value for what, one in of.items()})
        for id, of in said.items()
        if id in at
    }
    return found, [id for id in said if id not in at]


def map_changed_facade_ids(plan: Plan, corrections: Corrections, crs: CRS | str) -> dict[str, str]:
    """Map the recorded id of each corrected facade whose id changed to its present id."""
    facades, known = plan.facades, set(plan.facades.id)
    said = corrections.select_kinds(FACADE_CORRECTION_KINDS)
    lost = [(id, next(iter(of.values()))) for id, of in said.items() if id not in known]
    placed = [(id, one, one.place) for id, one in lost if one.place is not None]
    if not placed or not len(facades):
        return {}
    feet = plan.scene.charts.points_at_shares(facades.chart, _FOOT_CORNERS)[..., :2].mean(axis=1)
    middle = shapely.STRtree(shapely.points(feet))
    places = np.array([place for *_, place in placed], np.float64)
    points = np.column_stack(coordinate_transform(LONLAT, crs)(*places.T))
    widths = np.array([np.nan if one.width is None else one.width for _, one, _ in placed], np.float64)
    which, near = middle.query(shapely.points(points), predicate="dwithin", distance=PLACE_M)
    distance = np.hypot(*(feet[near] - points[which]).T)
    is_alike = ~(np.abs(np.asarray(facades.width)[near] / widths[which] - 1) > ALIKE)  # True without a width
    which, near, distance = which[is_alike], near[is_alike], distance[is_alike]
    found: dict[str, str] = {}
    for index in np.lexsort((near, distance, which)).tolist():
        found.setdefault(placed[which[index]][0], facades.id[near[index]])
    return found
