"""Stage `textures`: write the textures of building models and aerial views to the base layer, a building at a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catalogs.block.reader import Block
from facade_core.core.arrays import Int64Array
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.shared.memory import LIBRARY_BYTES, PICTURE_PIXEL, bounded_pixel_count, peak_decoding_bytes
from tasks.stages.shared.scene_view import SceneView
from tasks.stages.shared.view_inputs import OFF_PLANE_M, bounding_box, textures_of_charts, view_own_textures
from tasks.stages.textures.worker import TextureInputs, compute_textures, write_textures

# Bytes per texel of a model's texture: colour, cover and places in the atlas.
TEXTURE_TEXEL = 40


def list_texture_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[TextureInputs]]:
    """List the units of stage `textures`: buildings with textures of their own."""
    buildings = plan.buildings_with_textures()
    if not buildings:
        return []
    texels = _texels_by_building(plan)
    pictures = plan.building_pictures()
    return [
        Unit(
            index,
            plan.scene.names[building],
            texture_inputs(run, plan, building, block.textures),
            texture_memory(int(texels[building]), [block.textures[p] for p in pictures.get(building, ())]),
            tuple(plan.list_textured_charts(building)),
        )
        for index, building in enumerate(buildings)
    ]


def _texels_by_building(plan: Plan) -> Int64Array:
    """Return the number of texels of the textured charts of each building, (b,)."""
    building = plan.scene.charts.building
    textured = np.flatnonzero(plan.textured & (building >= 0))
    totals = np.zeros(int(building.max(initial=-1)) + 1, np.int64)
    np.add.at(totals, building[textured], plan.texel_counts()[textured])
    return totals


def texture_inputs(run: Run, plan: Plan, building: int, textures: Sequence[Path]) -> TextureInputs:
    """Return the inputs of a building's charts that have textures of their own or are seen from above."""
    charts, above = plan.list_textured_charts(building), None
    if run.aerial is not None and charts:
        low, high = bounding_box(plan, charts)
        high[2] = np.inf
        objects = plan.scene_objects.digests_in_box(low - OFF_PLANE_M, high + OFF_PLANE_M)
        above = SceneView(run, tuple(charts), tuple(objects))
    return TextureInputs(
        own=view_own_textures(run, plan, charts, textures),
        aerial=run.aerial if charts else None,
        above=above,
        pictures=textures_of_charts(plan, charts, textures),
    )


def texture_memory(texels: int, pictures: Sequence[Path]) -> int:
    """Return the bytes that writing a building's own textures takes at most."""
    return (
        LIBRARY_BYTES
        + max(texels * TEXTURE_TEXEL, peak_decoding_bytes(pictures))
        + bounded_pixel_count(pictures) * PICTURE_PIXEL
    )


TEXTURES = Stage(
    "textures",
    "textured building",
    outline=lambda block, plan: [
        UnitOutline(plan.scene.names[building], tuple(plan.list_textured_charts(building)))
        for building in plan.buildings_with_textures()
    ],
    inputs=list_texture_units,
    compute=compute_textures,
    write=write_textures,
)
