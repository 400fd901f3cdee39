"""From chunks that cannot be read to the units that wrote them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from facade_core.atlas.arrays import STAGE_ARRAYS
from facade_core.atlas.integrity import ChunkCoordinates
from facade_core.atlas.journal import read_journal
from facade_core.atlas.stored_files import FILE_STAGES, FOLDERS, unit_files
from facade_core.core.zarr_types import StoreArray, StoreGroup
from facade_core.plan.plan import Plan
from tasks.stages.order import STAGES
from tasks.stages.surfaces.stage import parts_of_block


def give_up(group: StoreGroup, plan: Plan, lost: Mapping[str, Sequence[ChunkCoordinates] | None]) -> dict[str, set[int]]:
    """Empty the chunks that cannot be read; returns the units that they were of, by stage.

    lost: chunks by the path of their array; None where all are lost.
    """
    due: dict[str, set[int]] = defaultdict(set)
    for path, chunks in lost.items():
        array = group[path]
        folder, _, name = path.partition("/")
        units = range(array.shape[0]) if chunks is None else sorted({chunk[0] for chunk in chunks})
        if folder == "journal":
            due[name].update(units)
        elif folder == "panoramas":
            due["viewpoints"].update(units)
        elif folder == "exemplars":
            due["exemplars"].add(int(name.partition("/")[0]))
        elif folder not in FOLDERS:
            writers = [stage for stage, arrays in STAGE_ARRAYS.items() if path in (array.path for array in arrays)]
            for stage, found in units_of_charts(plan, _charts_at(plan, chunks)).items():
                due[stage].update(found if stage in writers else ())
        _empty(group, path, array, chunks)
    for stage in FILE_STAGES if any(path.partition("/")[0] in FOLDERS for path in lost) else ():
        for unit, record in enumerate(read_journal(group, stage)):  # of which every chunk can be read by now
            if not lost.keys().isdisjoint(unit_files(stage, unit, record)):
                due[stage].add(unit)
    return {stage: due[stage] for stage in STAGES if due[stage]}


def units_of_charts(plan: Plan, charts: Iterable[int]) -> dict[str, set[int]]:
    """Who writes on some charts, by stage and index."""
    chosen = set(charts)
    pairs = plan.street_charts
    written = pairs[plan.writable[pairs[:, 1]]]
    return {
        "textures": {
            unit for unit, building in enumerate(plan.textured_buildings()) if chosen & set(plan.own_charts(building))
        },
        "grounds": set(np.flatnonzero(np.isin(plan.ground_near_cameras(), sorted(chosen))).tolist()),
        "walls": {unit for unit, own in enumerate(plan.walls_near_cameras().values()) if not chosen.isdisjoint(own)},
        "facades": set(np.flatnonzero(np.isin(plan.facades.chart, sorted(chosen))).tolist()),
        "streets": set(written[np.isin(written[:, 1], sorted(chosen)), 0].tolist()),
        "surfaces": {unit for unit, (_, own) in enumerate(parts_of_block(plan)) if not chosen.isdisjoint(own)},
    }


def _charts_at(plan: Plan, chunks: Sequence[ChunkCoordinates] | None) -> list[int]:
    """The charts of which something lies in some chunks of the atlas."""
    spec, placement = plan.scene.spec, plan.scene.placement
    if chunks is None:
        return list(range(len(plan.ids)))
    cells = {chunk[:3] for chunk in chunks}
    return [
        chart
        for chart in range(len(plan.ids))
        if not cells.isdisjoint(map(tuple, placement.chunks(chart, spec.chunk, spec.gutter).tolist()))
    ]


def _empty(group: StoreGroup, path: str, array: StoreArray, chunks: Sequence[ChunkCoordinates] | None) -> None:
    if chunks is not None:
        for chunk in chunks:
            array.set_block_selection(chunk, array.fill_value)
        return
    group.create_array(
        path,
        shape=array.shape,
        chunks=array.chunks,
        dtype=array.dtype,
        fill_value=array.fill_value,
        dimension_names=array.metadata.dimension_names,
        attributes=dict(array.attrs),
        overwrite=True,
    )
