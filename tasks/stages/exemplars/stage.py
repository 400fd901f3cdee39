"""Stage `exemplars`: parse, complete and measure each exemplar once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from catalogs.block.reader import Block
from catalogs.readers.pictures.folders import label_map_path
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.seeds import EXEMPLAR_SEED, unit_seed
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.exemplars.worker import ExemplarInputs, process_exemplar
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE
from tasks.stages.shared.memory import (
    FACADE_TEXEL,
    LIBRARY_BYTES,
    PICTURE_PIXEL,
    bounded_pixel_count,
    detector_memory,
    given_network_memory,
    peak_decoding_bytes,
)


def list_exemplar_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[ExemplarInputs]]:
    """List the units of stage `exemplars`: one for each exemplar of the block."""
    return [
        Unit(i, path.stem, exemplar_inputs(run, path), exemplar_memory(path) + given_network_memory(run.models))
        for i, path in enumerate(block.exemplars)
    ]


def exemplar_inputs(run: Run, path: Path) -> ExemplarInputs:
    """Return the inputs of an exemplar."""
    return ExemplarInputs(
        picture=path,
        labels=label_map_path(path),
        models=replace(run.models, layout=None),
        storey=run.storey,
        texels_per_metre=run.texture.texels_per_metre,
        privacy=run.privacy,
        seed=unit_seed(run, path.stem, EXEMPLAR_SEED),
    )


def exemplar_memory(path: Path) -> int:
    """Return the bytes that preparing an exemplar takes at most."""
    kept = min(bounded_pixel_count([path]), MAX_EXEMPLAR_SIDE**2)
    return (
        LIBRARY_BYTES
        + detector_memory()
        + max(peak_decoding_bytes([path]) + kept * PICTURE_PIXEL, kept * (FACADE_TEXEL + PICTURE_PIXEL))
    )


EXEMPLARS = Stage(
    "exemplars",
    "exemplar",
    outline=lambda block, plan: [UnitOutline(path.stem) for path in block.exemplars],
    inputs=list_exemplar_units,
    process=process_exemplar,
)
