"""Chunks that cannot be read, and the units that wrote them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from facade_core.atlas.arrays import STAGE_ARRAYS
from facade_core.atlas.integrity import ChunkCoordinates
from facade_core.atlas.journal import JOURNAL, Record, read_journal
from facade_core.atlas.stored_files import FOLDERS
from facade_core.core.zarr_types import COMPRESSORS, StoreArray, StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.stage import Records, all_stages, stored_files


def empty_unreadable_chunks(
    group: StoreGroup, plan: Plan, lost: Mapping[str, Sequence[ChunkCoordinates] | None]
) -> dict[str, set[int]]:
    """Empty the chunks that cannot be read; returns the units that wrote them, by stage.

    Parameters
    ----------
    lost : chunks by the path of their array; None if all are lost.
    """
    due: dict[str, set[int]] = defaultdict(set)
    for path, chunks in sorted(
        lost.items(), key=lambda one: not one[0].startswith(JOURNAL)
    ):  # the journals tell the others
        array = group[path]
        folder, _, name = path.partition("/")
        units = range(array.shape[0]) if chunks is None else sorted({chunk[0] for chunk in chunks})
        if folder == JOURNAL:
            due[name].update(units)
        elif folder not in FOLDERS:
            charts = _charts_in_chunks(plan, chunks)
            for writer, arrays in STAGE_ARRAYS.items():
                if path in (array.path for array in arrays):
                    due[writer].update(units_writing_charts(plan, read_journal(group, writer), charts))
        _empty_chunks(group, path, array, chunks)
    for stage in all_stages() if any(path.partition("/")[0] in FOLDERS for path in lost) else ():
        for unit, record in enumerate(read_journal(group, stage.stage)):  # its unreadable chunks were emptied above
            if not lost.keys().isdisjoint(stored_files(record)):
                due[stage.stage].add(unit)
    return {one.stage: due[one.stage] for one in all_stages() if due[one.stage]}


def units_writing_charts(plan: Plan, records: Records, charts: Iterable[int]) -> set[int]:
    """Return the units that wrote some charts, by their records."""
    chosen = {f"{plan.ids[chart]:016x}" for chart in charts}
    return {unit for unit, record in enumerate(records) if record and not chosen.isdisjoint(record.get("digests", ()))}


def charts_of_records(plan: Plan, records: Iterable[Record | None]) -> set[int]:
    """Return the charts that some records tell of."""
    at = {f"{number:016x}": chart for chart, number in enumerate(plan.ids.tolist())}
    return {at[name] for record in records if record for name in record.get("digests", ()) if name in at}


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
        compressors=COMPRESSORS,
        fill_value=array.fill_value,
        dimension_names=array.metadata.dimension_names,
        attributes=dict(array.attrs),
        overwrite=True,
    )
