"""Which facade each correction is of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.block.corrections import OF_FACADES, Correction, Corrections
from catalogs.frames import LONLAT, between
from facade_core.plan import Plan
from facade_core.types import Corrected

if TYPE_CHECKING:
    from pyproj import CRS

# A facade that has another id than when it was corrected is the one there whose middle is no farther off, metres, and whose
# width differs by no more than this share.
PLACE_M, ALIKE = 2.0, 0.2
# Where a wall begins and ends at its foot, as shares of its chart.
_FOOT = np.array([[0.0, 1.0], [1.0, 1.0]])


def corrected_of(plan: Plan, corrections: Corrections, crs: CRS | str) -> tuple[dict[int, Corrected], list[str]]:
    """What somebody said of each facade of a plan in a frame, by index; and the ids of which no facade is left. One with
    another id is known by its place and width."""
    said = corrections.of_kind(OF_FACADES)
    at = {name: index for index, name in enumerate(plan.facades.id)}
    found = {at[id]: dict(one) for id, one in said.items() if id in at}
    lost = [id for id in said if id not in at]
    if lost:
        again = _by_place(plan, crs, [next(iter(said[id].values())) for id in lost])
        for number, index in sorted(again.items()):  # what is said of the facade itself is newer
            found[index] = dict(said[lost[number]]) | found.get(index, {})
        lost = [id for number, id in enumerate(lost) if number not in again]
    return {index: Corrected(**{what: one.value for what, one in of.items()}) for index, of in found.items()}, lost


def _by_place(plan: Plan, crs: CRS | str, said: Sequence[Correction]) -> dict[int, int]:
    """Which facade stands where each of some corrections was made, number -> facade: its middle within PLACE_M, and as wide."""
    facades = plan.facades
    if not len(facades):
        return {}
    feet = plan.scene.charts.at_shares(facades.chart, _FOOT)[..., :2]
    middle = shapely.STRtree(shapely.points(feet.mean(axis=1)))
    found = {}
    for number, one in enumerate(said):
        if one.place is None:
            continue
        x, y = between(LONLAT, crs)(np.array([one.place[0]]), np.array([one.place[1]]))
        near = middle.query(shapely.points(x[0], y[0]), predicate="dwithin", distance=PLACE_M).tolist()
        alike = [f for f in near if one.width is None or abs(float(facades.width[f]) / one.width - 1) <= ALIKE]
        if alike:
            found[number] = min(alike, key=lambda f: (float(np.hypot(*(feet[f].mean(axis=0) - [x[0], y[0]]))), f))
    return found
