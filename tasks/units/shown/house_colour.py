"""The colour of a building's walls, by its facades that pictures show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.atlas.provenance import PHOTO
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.labels import UNKNOWN, WALL
from facade_core.plan import Plan
from facade_core.street.own_walls import wall_material


def colour_of_pictured(group: StoreGroup, plan: Plan, facades: Sequence[int]) -> np.ndarray | None:
    """The wall's colour (3,), 0..255, of that facade of which pictures show most of the wall; None where they show too little.

    facades: those of a building that are written, which may turn out to have been made without their pictures.
    """
    placement, shown = plan.scene.placement, []
    for facade in facades:
        chart = int(plan.facades.chart[facade])
        y, x = int(placement.y[chart]), int(placement.x[chart])
        rows, columns = slice(y, y + int(placement.height[chart])), slice(x, x + int(placement.width[chart]))
        part = (int(placement.page[chart]), rows, columns)
        labels = np.asarray(group["facade_maps/labels"][part])
        seen = np.where(np.asarray(group["atlas/seed_evidence"][part]) == PHOTO, labels, UNKNOWN)
        density = float(placement.texels_per_metre[chart])
        material = wall_material(np.asarray(group["atlas/seed"][part]), seen, density)
        if material is not None:
            shown.append((float((seen == WALL).sum()) / density**2, -facade, material.colour))
    return max(shown, key=lambda one: one[:2])[2] if shown else None
