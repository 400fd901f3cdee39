"""Units of a block's plan, counted without the rays of viewpoints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from facade_core.core.arrays import Float64Array
from facade_core.core.types import IngestSettings
from facade_core.geometry.charts import ChartKind
from facade_core.plan.core_region import CoreRegion
from facade_core.plan.facades import free_wall_mask
from facade_core.plan.ingest import BlockInputs, build_scene_layout, complete_plan
from facade_core.plan.plan import Plan
from facade_core.plan.posed_pictures import place_pictured_facades


@dataclass(frozen=True)
class PlannedUnits:
    """Number of units and texels of a block.

    Attributes
    ----------
    facades : free walls. Rays may find a few more with a small free part, and none of them where walls without
        pictures are plain.
    viewpoints : viewpoints on the block's own streets.
    ground : charts of the ground.
    texels : texels of the charts that the block textures.
    """

    facades: int
    viewpoints: int
    ground: int
    texels: int


def count_units(
    inputs: BlockInputs,
    settings: IngestSettings,
    core: CoreRegion | None = None,
    photo_resolution: Callable[[Plan], Float64Array] | None = None,
) -> PlannedUnits:
    """Count the units of a block by its charts, and texels with its pictures.

    Parameters
    ----------
    inputs, settings, core : as of `facade_core.plan.ingest.build_plan`.
    photo_resolution : returns the pixels per metre of the photo of each facade of a plan, 0 without one.

    Raises
    ------
    GeometryError
        Where the block has no geometry.
    """
    layout = build_scene_layout(inputs, settings, core=core)
    charts, own = layout.scene.charts, layout.in_core
    without_views = complete_plan(replace(layout, viewpoints=[]), inputs, settings, core=core)
    plan = place_pictured_facades(without_views, photos=photo_resolution and photo_resolution(without_views))
    free = free_wall_mask(layout.scene, inputs.buildings, layout.free_share)
    walked = [core is None or layout.streets[camera.street].id in core.streets for camera in layout.viewpoints]
    return PlannedUnits(
        facades=int((free & own).sum()),
        viewpoints=sum(walked),
        ground=int(((charts.kind == ChartKind.GROUND) & own).sum()),
        texels=int(plan.texel_counts()[own].sum()),
    )
