"""Texel density of facades by the resolution of their pictures, within a budget of texels per building."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.geometry.chart_packing import has_own_chunks
from facade_core.geometry.charts import raster_sizes
from facade_core.plan.plan import Plan
from facade_core.plan.settings import PICTURED_DENSITY


def pictured_density(plan: Plan, photos: Float64Array | None = None) -> Float64Array:
    """Compute the texel density of charts: by the streets, raised on facades to the resolution of their best picture.

    The facades of a building share a budget, in the order of resolution times shown share, so that a picture of one
    building changes no other. Facades that round a bend share one density. Raised facades have chunks of their own at
    either density, so that no other chart is moved.

    Parameters
    ----------
    photos : (facades,) pixels per metre of the photo of each facade, which is taken before its panoramas; 0 without one.

    Returns
    -------
    (charts,) texels per metre.
    """
    charts, facades, spec = plan.scene.charts, plan.facades, plan.scene.spec
    density, chart = plan.street_density.copy(), plan.facades.chart
    step = PICTURED_DENSITY.density_step * spec.texels_per_metre
    resolution, benefit = _best_pictures(plan)
    if photos is not None:
        resolution, benefit = (np.where(photos > 0, photos, of_panoramas) for of_panoramas in (resolution, benefit))
    side = charts.size[chart].max(axis=1, initial=0.0)
    most = np.minimum(
        min(PICTURED_DENSITY.max_density_factor * spec.texels_per_metre, PICTURED_DENSITY.max_pictured_density),
        (spec.page - 2 * spec.gutter) / np.maximum(side, 1e-9),
    )
    wanted = np.where(_can_be_raised(plan), np.minimum(np.rint(resolution / step) * step, most), 0.0)
    np.minimum.at(wanted, facades.run, wanted.copy())
    np.minimum.at(benefit, facades.run, benefit.copy())
    area = charts.size.prod(axis=1)
    run_area = np.bincount(facades.run, area[chart], len(chart))
    owned = charts.building >= 0
    texels = np.bincount(charts.building[owned], (area * density**2)[owned])
    left = PICTURED_DENSITY.max_added_texels * texels
    first = np.flatnonzero(wanted > density[chart])
    first = first[facades.run[first] == first]
    for run in first[np.lexsort([first, -benefit[first]])].tolist():
        building, before = facades.building[run], density[chart[run]]
        affordable = np.sqrt(left[building] / run_area[run] + before**2)
        after = np.floor(min(wanted[run], affordable) / step + 1e-9) * step
        if after > before:
            density[chart[facades.run == run]] = after
            left[building] -= run_area[run] * (after**2 - before**2)
    return density


def _best_pictures(plan: Plan) -> tuple[Float64Array, Float64Array]:
    """Return the pixels per metre of the finest picture of each facade, (facades,), and that times the share it shows."""
    seen = plan.sightings
    resolution, benefit = np.zeros(len(plan.facades)), np.zeros(len(plan.facades))
    used = seen.seen >= PICTURED_DENSITY.min_shown_share
    np.maximum.at(resolution, seen.facade[used], seen.pixels_per_metre[used])
    np.maximum.at(benefit, seen.facade[used], (seen.seen * seen.pixels_per_metre)[used])
    return resolution, benefit


def _can_be_raised(plan: Plan) -> BoolArray:
    """Return the facades that streets do not write and that share no chunk with other charts, (facades,)."""
    chart, spec = plan.facades.chart, plan.scene.spec
    texels = raster_sizes(plan.scene.charts.size[chart], plan.street_density[chart])
    return has_own_chunks(texels + 2 * spec.gutter, spec.chunk) & ~plan.writable[chart]
