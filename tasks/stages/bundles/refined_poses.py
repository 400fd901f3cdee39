"""Poses of panoramas as the journal has them."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from facade_core.atlas.journal import Record, read_journal
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from tasks.stages.bundles.record import BundleRecord
from tasks.stages.poses.record import BundledPoseRecord, PoseRecord


def pose_from_record(pose: Pose, record: PoseRecord | None) -> Pose:
    """Return the pose of a panorama by its record; the given one if it was not refined."""
    if record is None or record["status"] != "done":
        return pose
    x, y, z, heading, pitch, roll = record["pose"]
    return replace(pose, x=x, y=y, z=z, heading=heading, pitch=pitch, roll=roll)


def is_rejected_panorama(record: Record | None) -> bool:
    """Report whether a panorama's record says that it could not be placed."""
    return record is not None and record["status"] == "failed"


def read_bundled_pose_records(group: StoreGroup) -> list[BundledPoseRecord | None]:
    """Read the pose records of panoramas, with the fields that their bundles replace.

    A bundle counts for a panorama that still has the pose from which the bundle was refined.
    """
    records: list[BundledPoseRecord | None] = list(read_journal(group, "poses", BundledPoseRecord))
    at = {record["unit"]: index for index, record in enumerate(records) if record and record["status"] == "done"}
    for bundle in read_journal(group, "bundles", BundleRecord):
        if bundle is None or bundle["status"] != "done":
            continue
        for name, change in bundle["together"].items():
            record = records[at[name]] if name in at else None
            if record is not None and record["pose"] == change["alone"]:
                records[at[name]] = cast(BundledPoseRecord, {**record, **change["found"]})
    return records
