"""Inputs of relighting, read from a published block's store."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import cast

import numpy as np

from facade_core.core.types import Sun
from facade_core.export.lighting.relighting import MAX_CACHED_CHARTS, RelightingInputs, StoredChartTexels
from facade_core.export.lighting.street_light import lamp_emitters
from facade_core.street.lighting.light import SceneLight
from tasks.publish.published_run import PublishedBlock
from tasks.stages.shared.materials import rebuild_material_field


def relighting_inputs(results: PublishedBlock, *, has_relief: bool = False) -> RelightingInputs:
    """Read the inputs of relighting; `has_relief` if the elements of facades are geometry.

    The light of colours stays that a store of an earlier version holds.
    """
    plan, group = results.plan, results.group
    placement = plan.scene.placement
    field = rebuild_material_field(group, plan)

    @lru_cache(maxsize=MAX_CACHED_CHARTS)
    def texels(chart: int) -> StoredChartTexels:
        part = placement.region(chart)
        provenance = np.asarray(group["atlas/provenance"][part])
        if not plan.is_facade(chart):
            return StoredChartTexels(provenance, None, None)
        return StoredChartTexels(
            provenance, np.asarray(group["atlas/seed"][part]), np.asarray(group["facade_maps/labels"][part])
        )

    stated = cast(Sequence[float] | None, group.attrs.get("sun"))
    sun = Sun(*map(float, stated)) if stated else None
    return RelightingInputs(
        plan.scene,
        plan.ground,
        field.arrays.charts.material,
        plan.textured,
        plan.ids.tolist(),
        SceneLight(plan.scene, field.reflectance, sun) if group.attrs.get("light") else None,
        texels,
        has_relief,
        lamp_emitters(plan.objects),
    )


def is_mostly_photographed(results: PublishedBlock) -> bool:
    """Report whether most texels of a block's buildings are textures of the source model."""
    plan = results.plan
    own = plan.in_core & (plan.scene.charts.building >= 0)
    texels = plan.texel_counts()
    return bool(2 * texels[own & plan.textured].sum() > texels[own].sum())
