"""From a block to its plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from facade_core.geometry.packing import Places
from facade_core.ingest import ingest
from facade_core.plan import Plan
from tasks.units.images import image_size
from tasks.units.materials import under_aerial

if TYPE_CHECKING:
    from catalogs.block import Block


def plan_of(block: Block, last: Places | None = None) -> Plan:
    """Ingest a block as its settings say; with the places of an earlier ingest, charts stay where they are in the atlas."""
    texture = block.texture
    plan = ingest(
        block.buildings,
        block.streets,
        elevation=block.terrain,
        poses=[panorama.pose for panorama in block.panoramas],
        panorama_sizes=[image_size(panorama.path) for panorama in block.panoramas],
        texels_per_metre=texture.texels_per_metre,
        spacing=texture.viewpoint_spacing,
        height=texture.viewpoint_height,
        visibility_range=texture.visibility_range,
        panorama_width=texture.panorama_width,
        storey=block.storey,
        walls=texture.walls,
        last=last,
    )
    return plan if block.aerial is None else under_aerial(plan, block.aerial)
