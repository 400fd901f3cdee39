"""Stage `exemplars`: parse, complete and measure each exemplar once."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from catalogs.block.reader import Block
from catalogs.file_digest import file_digest
from catalogs.readers.pictures.folders import picture_and_label_paths
from facade_core.core.types import TrainedModelFiles
from facade_core.core.zarr_types import StoreGroup, get_subgroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import (
    IntegrityInputs,
    Records,
    ReingestContext,
    Stage,
    is_done_record,
    match_units_by_key_or_name,
)
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.exemplars.worker import process_exemplar
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE
from tasks.stages.shared.key_parts import model_key_parts
from tasks.stages.shared.memory import (
    FACADE_TEXEL,
    LIBRARY_BYTES,
    PICTURE_PIXEL,
    bounded_pixel_count,
    detector_memory,
    peak_decoding_bytes,
)


def list_exemplar_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `exemplars`: one for each exemplar of the block."""
    return [
        Unit(i, path.stem, (exemplar_key(run, path),), (path,), exemplar_memory(path))
        for i, path in enumerate(block.exemplars)
    ]


def _match_previous(change: ReingestContext) -> dict[int, int]:
    units = list_exemplar_units(change.run, change.block, change.after, change.group)
    return match_units_by_key_or_name(change.records["exemplars"], units)


def _relocate(change: ReingestContext, again: Mapping[int, int], records: Records) -> Records:
    for new, old in again.items():
        if new != old:
            _copy_arrays(change.group, change.last, new, old)
    return records


def _copy_arrays(group: StoreGroup, last: StoreGroup, new: int, old: int) -> None:
    for name, array in get_subgroup(last, f"exemplars/{old}").arrays():
        group.create_array(
            f"exemplars/{new}/{name}",
            data=array[:],
            chunks=array.chunks,
            dimension_names=array.metadata.dimension_names,
            overwrite=True,
        )


def exemplar_key(run: Run, path: Path) -> str:
    """Return the key of an exemplar: its picture, label map, settings and parser."""
    return join_key_parts(
        stage_code_digest("exemplars"),
        settings=[run.seed, run.storey, run.texture.texels_per_metre, run.privacy],
        picture=[path.stem, *map(file_digest, picture_and_label_paths(path))],
        **model_key_parts(TrainedModelFiles(parser=run.models.parser)),  # an exemplar is parsed and not completed
    )


def exemplar_memory(path: Path) -> int:
    """Return the bytes that preparing an exemplar takes at most."""
    kept = min(bounded_pixel_count([path]), MAX_EXEMPLAR_SIDE**2)
    return (
        LIBRARY_BYTES
        + detector_memory()
        + max(peak_decoding_bytes([path]) + kept * PICTURE_PIXEL, kept * (FACADE_TEXEL + PICTURE_PIXEL))
    )


def _find_lost(store: IntegrityInputs) -> list[int]:
    """Find exemplars without their arrays."""
    return [
        i
        for i, record in enumerate(store.records["exemplars"])
        if is_done_record(record) and not all(f"exemplars/{i}/{name}" in store.group for name in ("image", "labels"))
    ]


EXEMPLARS = Stage(
    "exemplars",
    "exemplar",
    count=lambda block, plan: len(block.exemplars),
    match_previous=_match_previous,
    units=list_exemplar_units,
    function=process_exemplar,
    in_every_block=True,
    relocate=_relocate,
    unit_folder="exemplars",
    find_lost=_find_lost,
)
