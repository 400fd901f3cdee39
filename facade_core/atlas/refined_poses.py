"""What the journal says of panoramas once they were refined alone and then together."""

from __future__ import annotations

from typing import cast

from facade_core.atlas.journal import Record, read_journal
from facade_core.core.zarr_types import StoreGroup


def read_refined_poses(group: StoreGroup) -> list[Record | None]:
    """The records of panoramas by index, with what their bundles found in place of what is of them alone; what a bundle says
    counts where it is of the pose that a panorama has alone now."""
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
