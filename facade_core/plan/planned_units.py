"""Units of a block's plan, counted without casting a ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.geometry.charts import ChartKind
from facade_core.plan.core_region import CoreRegion
from facade_core.plan.facades import free_wall_mask
from facade_core.plan.ingest import BlockInputs, IngestSettings, build_scene_layout


@dataclass(frozen=True)
class PlannedUnits:
    """Number of units and texels of a block.

    Attributes
    ----------
    facades : free walls. Rays may find a few more with a small free part, and none of them where streets paint walls.
    viewpoints : viewpoints on the block's own streets.
    ground : charts of the ground.
    texels : texels of the charts that the block textures.
    """

    facades: int
    viewpoints: int
    ground: int
    texels: int


def count_units(inputs: BlockInputs, settings: IngestSettings, core: CoreRegion | None = None) -> PlannedUnits:
    """Count the units of a block by its charts; parameters as of `facade_core.plan.ingest.build_plan`.

    Raises
    ------
    GeometryError
        Where the block has no geometry.
    """
    layout = build_scene_layout(inputs, settings, core=core)
    charts, placement, own = layout.scene.charts, layout.scene.placement, layout.in_core
    free = free_wall_mask(layout.scene, inputs.buildings, layout.free_share)
    walked = [core is None or layout.streets[camera.street].id in core.streets for camera in layout.viewpoints]
    return PlannedUnits(
        facades=int((free & own).sum()),
        viewpoints=sum(walked),
        ground=int(((charts.kind == ChartKind.GROUND) & own).sum()),
        texels=int((placement.width.astype(np.int64) * placement.height)[own].sum()),
    )
