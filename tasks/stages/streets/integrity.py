"""Integrity of streets and viewpoints: panoramas that are missing or differ, streets over other viewpoints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from facade_core.atlas.integrity import list_chunks
from facade_core.atlas.journal import read_journal, unit_key
from facade_core.atlas.rasters import picture_digest
from facade_core.atlas.store import open_table
from facade_core.core.grouping import RowsByValue
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.outcome import is_done_for_keys
from tasks.engine.run import Run
from tasks.engine.stage import IntegrityInputs, is_done_record
from tasks.engine.store.digests import sample_evenly
from tasks.stages.streets.keys import street_keys
from tasks.stages.streets.record import StreetRecord, ViewpointRecord


def find_lost_viewpoints(store: IntegrityInputs) -> list[int]:
    """Find viewpoints whose stored panorama is not listed. A black one has no chunk: its record says so."""
    listed = {chunk[0] for chunk in list_chunks(store.session, "panoramas/rgb")}
    black = ""
    found = []
    for viewpoint, record in enumerate(cast(Sequence[ViewpointRecord | None], store.records["viewpoints"])):
        if record is None or not is_done_record(record) or "panorama" not in record or viewpoint in listed:
            continue
        black = black or picture_digest(np.zeros(store.group["panoramas/rgb"].shape[1:], np.uint8))
        if record["panorama"] != black:
            found.append(viewpoint)
    return found


def find_lost_streets(store: IntegrityInputs) -> list[int]:
    """Find streets that are done and blend a viewpoint that is lost or replaced; none of a material field."""
    street_of = open_table(store.session, "viewpoints").street.values
    viewpoints_of, lost = RowsByValue(street_of), set(store.lost["viewpoints"])
    held = [
        None if i in lost or not is_done_record(record) else record
        for i, record in enumerate(store.records["viewpoints"])
    ]
    found = []
    for street, record in enumerate(cast(Sequence[StreetRecord | None], store.records["streets"])):
        if record is None or not is_done_record(record) or not record.get("chain"):
            continue
        keys = [one["key"] if (one := held[v]) else None for v in viewpoints_of.rows_with(street).tolist()]
        if None in keys or record["chain"] != unit_key(keys):
            found.append(street)
    return found


def confirm_lost_streets(run: Run, plan: Plan, group: StoreGroup, units: Sequence[int]) -> list[int]:
    """Return the lost streets that are done by their present key: the others are pending anyway."""
    records = read_journal(group, "streets")
    return [
        street for street in units if is_done_for_keys(records[street], street_keys(run, plan, group, street).street)
    ]


def find_differing_panoramas(group: StoreGroup, plan: Plan, sample: int | None) -> dict[str, list[int]]:
    """Find viewpoints whose panorama differs from its digest, and their streets."""
    pictures = [
        (viewpoint, record["panorama"])
        for viewpoint, record in enumerate(read_journal(group, "viewpoints", ViewpointRecord))
        if record and record["status"] == "done" and "panorama" in record
    ]
    viewpoints = [
        viewpoint
        for viewpoint, digest in sample_evenly(pictures, sample)
        if picture_digest(group["panoramas/rgb"][viewpoint]) != digest
    ]
    return {"viewpoints": viewpoints, "streets": [plan.viewpoints[viewpoint].street for viewpoint in viewpoints]}
