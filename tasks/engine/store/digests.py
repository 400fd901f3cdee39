"""Comparison of arrays with the digests in the journal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np

from facade_core.atlas.arrays import STAGE_ARRAYS
from facade_core.atlas.journal import read_journal
from facade_core.atlas.rasters import TexelLayout, chart_digests, read_rasters
from facade_core.atlas.stored_files import digest_stored_file
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.stage import all_stages, stored_files

T = TypeVar("T")


def find_differing_units(group: StoreGroup, plan: Plan, sample: int | None = None) -> dict[str, list[int]]:
    """Find the units whose charts or files differ from the digests in their records, by stage.

    Units that are not done, and records without digests, are skipped. Every chunk must be readable.

    Parameters
    ----------
    sample : maximal number of charts, and files of each stage, evenly spread; None for all.
    """
    found = [*_find_differing_charts(group, plan, sample), *_find_differing_files(group, sample)]
    units: dict[str, set[int]] = defaultdict(set)
    for stage, unit in found:
        units[stage].add(unit)
    return {stage: sorted(own) for stage, own in units.items()}


def _find_differing_charts(group: StoreGroup, plan: Plan, sample: int | None) -> Iterator[tuple[str, int]]:
    """Find stage and unit of charts that differ from the digests of their last writer."""
    chart_of = {f"{number:016x}": chart for chart, number in enumerate(plan.ids.tolist())}
    writers = [one for one in last_chart_writers(group) if one[0] in chart_of]
    for name, stage, unit, digest in sample_evenly(sorted(writers), sample):
        one = TexelLayout.of_charts(plan.scene.placement, [chart_of[name]])
        colour, source = (
            read_rasters(group[array.path], plan.scene.placement, one) for array in STAGE_ARRAYS[stage][:2]
        )
        if chart_digests(colour, source, plan.scene.placement, one, plan.ids)[name] != digest:
            yield stage, unit


def _find_differing_files(group: StoreGroup, sample: int | None) -> Iterator[tuple[str, int]]:
    """Find stage and unit of files that differ from the digests in the records."""
    for owner in all_stages():
        journal = read_journal(group, owner.stage)
        files = [(unit, stored_files(record)) for unit, record in enumerate(journal)]
        for unit, wanted in sample_evenly([one for one in files if one[1]], sample):
            for path, digest in wanted.items():
                if path in group and digest_stored_file(np.asarray(group[path][:]).tobytes()) != digest:
                    yield owner.stage, unit


def last_chart_writers(group: StoreGroup) -> list[tuple[str, str, int, str]]:
    """Return for each chart and stage the last unit that wrote it and its digest; none if that unit is pending."""
    found: dict[tuple[str, str], tuple[int, str]] = {}
    due: set[tuple[str, str]] = set()
    for stage in STAGE_ARRAYS:
        records = [(i, record) for i, record in enumerate(read_journal(group, stage)) if record]
        for unit, record in sorted(records, key=lambda one: one[1]["unit"]):
            for chart, digest in record.get("digests", {}).items():
                found[chart, stage] = (unit, digest)
                (due.discard if record["status"] == "done" else due.add)((chart, stage))
    return [(chart, stage, *writer) for (chart, stage), writer in found.items() if (chart, stage) not in due]


def sample_evenly(values: Sequence[T], count: int | None) -> Sequence[T]:
    """Return at most `count` values, evenly spread; all if it is None."""
    if count is None or len(values) <= count:
        return values
    return [values[int(i)] for i in np.linspace(0, len(values) - 1, count)]
