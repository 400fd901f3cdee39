"""Chunks that cannot be read, and the units that wrote them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from facade_core.atlas.arrays import STAGE_ARRAYS
from facade_core.atlas.integrity import ChunkCoordinates
from facade_core.atlas.journal import read_journal
from facade_core.atlas.stored_files import FOLDERS
from facade_core.core.zarr_types import StoreArray, StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.stage import all_stages


def empty_unreadable_chunks(
    group: StoreGroup, plan: Plan, lost: Mapping[str, Sequence[ChunkCoordinates] | None]
) -> dict[str, set[int]]:
    """Empty the chunks that cannot be read; returns the units that wrote them, by stage.

    Parameters
    ----------
    lost : chunks by the path of their array; None if all are lost.
    """
    due: dict[str, set[int]] = defaultdict(set)
    for path, chunks in lost.items():
        array = group[path]
        folder, _, name = path.partition("/")
        units = range(array.shape[0]) if chunks is None else sorted({chunk[0] for chunk in chunks})
        if folder == "journal":
            due[name].update(units)
        elif owner := next((one for one in all_stages() if one.array_folder == folder), None):
            due[owner.stage].update(units)
        elif owner := next((one for one in all_stages() if one.unit_folder == folder), None):
            due[owner.stage].add(int(name.partition("/")[0]))
        elif folder not in FOLDERS:
            writers = [stage for stage, arrays in STAGE_ARRAYS.items() if path in (array.path for array in arrays)]
            for stage, found in units_writing_charts(plan, _charts_in_chunks(plan, chunks)).items():
                due[stage].update(found if stage in writers else ())
        _empty_chunks(group, path, array, chunks)
    for owner in all_stages() if any(path.partition("/")[0] in FOLDERS for path in lost) else ():
        for unit, record in enumerate(
            read_journal(group, owner.stage) if owner.files else ()
        ):  # of which every chunk can be read by now
            if not lost.keys().isdisjoint(owner.unit_files(unit, record)):
                due[owner.stage].add(unit)
    return {one.stage: due[one.stage] for one in all_stages() if due[one.stage]}


def units_writing_charts(plan: Plan, charts: Iterable[int]) -> dict[str, set[int]]:
    """Return the units that write on some charts, by stage."""
    chosen = set(charts)
    return {
        stage.stage: {unit for unit, own in enumerate(stage.unit_charts(plan)) if not chosen.isdisjoint(own)}
        for stage in all_stages()
        if stage.unit_charts is not None
    }


def _charts_in_chunks(plan: Plan, chunks: Sequence[ChunkCoordinates] | None) -> list[int]:
    """Return the charts that touch some chunks of the atlas."""
    spec, placement = plan.scene.spec, plan.scene.placement
    if chunks is None:
        return list(range(len(plan.ids)))
    cells = {chunk[:3] for chunk in chunks}
    return [
        chart
        for chart in range(len(plan.ids))
        if not cells.isdisjoint(map(tuple, placement.chunks(chart, spec.chunk, spec.gutter).tolist()))
    ]


def _empty_chunks(group: StoreGroup, path: str, array: StoreArray, chunks: Sequence[ChunkCoordinates] | None) -> None:
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
