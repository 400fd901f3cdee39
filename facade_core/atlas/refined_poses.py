"""Records of panoramas after single and joint refinement of their poses."""

from __future__ import annotations

from typing import cast

from facade_core.atlas.journal import Record, read_journal
from facade_core.core.zarr_types import StoreGroup


def read_refined_poses(group: StoreGroup) -> list[Record | None]:
    """Return the records of panoramas by index, with the joint refinement merged in.

    A bundle's result counts only if it started from the panorama's current single pose.
    """
    records = read_journal(group, "poses")
    at = {record["unit"]: index for index, record in enumerate(records) if record and record["status"] == "done"}
    for bundle in read_journal(group, "bundles"):
        if bundle is None or bundle["status"] != "done":
            continue
        for name, told in bundle["together"].items():
            record = records[at[name]] if name in at else None
            if record is not None and record["pose"] == told["alone"]:
                records[at[name]] = cast(Record, {**record, **told["found"]})
    return records
