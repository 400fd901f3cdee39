"""Worker of `textures`: write a building's own textures and the aerial view of it, on every chart but facades."""

from __future__ import annotations

import time
from typing import cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.atlas.rasters import TexelLayout, chart_digests, write_rasters
from facade_core.atlas.store import open_root
from facade_core.core.provenance import Provenance
from facade_core.geometry.overhead_view import resample_aerial_to_chart, upward_roof_mask
from facade_core.imagery.rectify.model_texture import render_model_texture
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.outcome import rejection_record_fields
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.shared.images import read_textures
from tasks.stages.shared.materials import aerial_sampler
from tasks.stages.textures.record import TexturedBuildingRecord


def process_textures(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write the textured charts of one building through the fork; returns the fork and the record."""
    start = time.time()
    (unit,) = units
    building, textures = unit.arguments
    plan = load_run_plan(run)
    scene = plan.scene
    charts = plan.list_textured_charts(building)
    refused: list[Exception] = []
    images = read_textures(textures, scene.mesh.texture[np.isin(scene.mesh.chart, charts)], refused)
    group = open_root(fork)
    digests: dict[str, str] = {}
    aerial, roofs = aerial_sampler(run), upward_roof_mask(scene)
    for chart in charts:
        rgb, covered = render_model_texture(scene, chart, images)
        if aerial is not None and roofs[chart]:
            seen, known = resample_aerial_to_chart(scene, chart, aerial)
            rgb, covered = np.where((known & ~covered)[..., None], seen, rgb), covered | known
        seed = rgb.reshape(-1, 3)
        evidence = np.where(covered, Provenance.PHOTO, Provenance.UNSEEN).astype(np.uint8).reshape(-1)
        rasters = TexelLayout.of_charts(scene.placement, [chart])
        for array, flat in {"seed": seed, "seed_evidence": evidence}.items():
            write_rasters(group[f"atlas/{array}"], scene.spec, scene.placement, rasters, flat)
        digests |= chart_digests(seed, evidence, scene.placement, rasters, plan.ids)
    record: TexturedBuildingRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "charts": len(charts),
        "digests": digests,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"texture": round(time.time() - start, 4)},
    }
    record |= cast(TexturedBuildingRecord, rejection_record_fields(refused, "without it"))
    return fork, {unit.index: record}
