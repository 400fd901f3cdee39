"""Wall colour of a building, from its facades with pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.wall_material import MIN_WALL_M2, lit_colour
from facade_core.plan.plan import Plan

# Texels of a facade that are looked at, evenly over it: a colour needs no more, and units declare no memory for neighbours.
MAX_SAMPLED_TEXELS = 1 << 17


def photo_wall_colour(group: StoreGroup, plan: Plan, facades: Sequence[int]) -> Float64Array | None:
    """Return the wall colour (3,), 0..255, of the facade whose pictures show most of the wall; None if they show too little.

    Parameters
    ----------
    facades : facades of a building that are written; some may have been made without their pictures.
    """
    placement, largest, found = plan.scene.placement, MIN_WALL_M2, None
    for facade in facades:
        chart = int(plan.facades.chart[facade])
        y, x = int(placement.y[chart]), int(placement.x[chart])
        height, width = placement.shape(chart)
        step = max(1, round((height * width / MAX_SAMPLED_TEXELS) ** 0.5))
        part = (int(placement.page[chart]), slice(y, y + height, step), slice(x, x + width, step))
        labels, evidence = (np.asarray(group[name][part]) for name in ("facade_maps/labels", "atlas/seed_evidence"))
        on = (labels == FacadeClass.WALL) & (evidence == Provenance.PHOTO)
        shown = float(on.sum()) * (step / float(placement.texels_per_metre[chart])) ** 2
        if shown > largest:
            largest, found = shown, lit_colour(np.asarray(group["atlas/seed"][part])[on])
    return found
