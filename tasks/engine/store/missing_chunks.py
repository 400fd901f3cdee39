"""Charts and units of which chunks are missing from a snapshot's listing."""

from __future__ import annotations

from collections.abc import Iterable

import icechunk

from facade_core.atlas.integrity import list_chunks
from facade_core.atlas.store import open_table
from facade_core.plan.plan_tables import placement_from_table, read_table
from tasks.engine.stage import Records, is_done_record


def find_charts_with_missing_chunks(session: icechunk.Session, array: str, charts: Iterable[int]) -> set[int]:
    """Find charts of which a chunk of an array over the pages is not listed."""
    table, there = read_table(session, "charts"), list_chunks(session, array)
    placement = placement_from_table(table)
    chunk, gutter = table["chunk"], table["gutter"]
    return {c for c in charts if not there.issuperset(map(tuple, placement.chunks(c, chunk, gutter).tolist()))}


def find_units_without_base_layer(session: icechunk.Session, records: Records) -> list[int]:
    """Find units from panoramas of which no chunk is listed: chunks without photographed texels are never written."""
    made = {
        name: i for i, record in enumerate(records) if record and is_done_record(record) for name in record["digests"]
    }
    if not made:
        return []
    ids = open_table(session, "charts").id.values.tolist()
    table, there = read_table(session, "charts"), list_chunks(session, "atlas/seed_evidence")
    placement = placement_from_table(table)
    return sorted(
        made[f"{ids[chart]:016x}"]
        for chart, number in enumerate(ids)
        if f"{number:016x}" in made
        and there.isdisjoint(map(tuple, placement.chunks(chart, table["chunk"], table["gutter"]).tolist()))
    )
