"""Units of which chunks are missing from a snapshot's listing."""

from __future__ import annotations

import icechunk

from facade_core.atlas.arrays import STAGE_ARRAYS
from facade_core.atlas.integrity import list_chunks
from facade_core.atlas.store import open_table
from facade_core.plan.plan_tables import placement_from_table, read_table
from tasks.engine.stage import Records, is_done_record


def find_units_with_missing_chunks(session: icechunk.Session, stage: str, records: Records) -> set[int]:
    """Find units that are done and whose charts lack chunks in the listing.

    A chunk of nothing but texels without a source is never written: a unit with such texels is found only if no chunk of it
    is listed.
    """
    done = {i: record for i, record in enumerate(records) if record and is_done_record(record)}
    if stage not in STAGE_ARRAYS or not any(record.get("digests") for record in done.values()):
        return set()
    at = {f"{number:016x}": chart for chart, number in enumerate(open_table(session, "charts").id.values.tolist())}
    table, listed = read_table(session, "charts"), list_chunks(session, STAGE_ARRAYS[stage][1].path)
    placement = placement_from_table(table)
    lost = set()
    for unit, record in done.items():
        cells = {
            tuple(cell)
            for name in record.get("digests", ())
            if name in at
            for cell in placement.chunks(at[name], table["chunk"], table["gutter"]).tolist()
        }
        is_complete = record.get("is_complete")
        if is_complete is not None and (not cells <= listed if is_complete else cells.isdisjoint(listed)):
            lost.add(unit)
    return lost
