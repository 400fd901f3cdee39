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
from tasks.engine.stage import ReingestContext, Stage
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.shared.key_parts import OFF_PLANE_M, bounding_box, own_texture_key_parts
from tasks.stages.shared.memory import LIBRARY_BYTES, PICTURE_PIXEL, bounded_pixel_count, peak_decoding_bytes
from tasks.stages.textures.worker import process_textures

# Bytes per texel of a model's texture: colour, cover and places in the atlas.
TEXTURE_TEXEL = 40


def list_texture_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
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
            (texture_key(run, plan, building, block.textures),),
            (building, block.textures),
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


def _match_previous(change: ReingestContext) -> dict[int, int]:
    """Match buildings whose textured charts all stay; the charts of others stay no longer."""

    def units(plan: Plan) -> dict[str, tuple[int, list[int]]]:
        buildings = enumerate(plan.buildings_with_textures())
        return {plan.scene.names[building]: (unit, plan.list_textured_charts(building)) for unit, building in buildings}

    before, again = units(change.before), {}
    for name, (unit, charts) in units(change.after).items():
        if name in before and [change.stays.get(chart) for chart in charts] == before[name][1]:
            again[unit] = before[name][0]
        else:
            for chart in charts:
                change.stays.pop(chart, None)
    return again


def texture_key(run: Run, plan: Plan, building: int, textures: Sequence[Path]) -> str:
    """Return the key of a building's charts that have textures of their own or are seen from above, without its facades."""
    charts = plan.list_textured_charts(building)
    parts: dict[str, object] = {
        "settings": run.texture.texels_per_metre,
        "own": own_texture_key_parts(plan, charts, textures),
    }
    if run.aerial is not None and charts:
        parts["aerial"] = [run.aerial.content, run.aerial.crs, run.aerial.frame]
        low, high = bounding_box(plan, charts)
        high[2] = np.inf
        parts["above"] = plan.scene_objects.digests_in_box(low - OFF_PLANE_M, high + OFF_PLANE_M)
    return join_key_parts(stage_code_digest("textures"), **parts)


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
    count=lambda block, plan: len(plan.buildings_with_textures()),
    match_previous=_match_previous,
    units=list_texture_units,
    function=process_textures,
    writes_base_layer=True,
    unit_charts=lambda plan: [plan.list_textured_charts(building) for building in plan.buildings_with_textures()],
    unit_names=lambda plan: [plan.scene.names[building] for building in plan.buildings_with_textures()],
)
