"""Rows of the item table and report: facades, and units that could not be used."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

import numpy as np

from catalogs.published.columns import ROW_KEYS, ItemRow, build_item_row
from catalogs.published.facade_values import FacadeSource, PanoramaPose
from facade_core.atlas.journal import Record, atlas_digest
from facade_core.core.json_types import JsonObject
from facade_core.core.types import Pose
from facade_core.geometry.walls import WALL_ROLES
from tasks.engine.outcome import set_aside_status
from tasks.engine.run import Run
from tasks.publish.stored_block import StoredBlock
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.order import FACADES, STAGES_IN_ORDER
from tasks.stages.poses.record import PoseRecord


@dataclass(frozen=True)
class ItemRows:
    """Rows of items.parquet.

    Attributes
    ----------
    facades : rows of facades, in their order in the plan.
    set_aside : rows of other units that could not be used.
    """

    facades: list[ItemRow]
    set_aside: list[ItemRow]

    @property
    def every(self) -> list[ItemRow]:
        """Return all rows."""
        return self.facades + self.set_aside

    @property
    def finished_facade_count(self) -> int:
        """Count the finished facades."""
        return sum(row["status"] == "done" for row in self.facades)

    @property
    def unfinished_facade_count(self) -> int:
        """Count the unfinished facades."""
        return len(self.facades) - self.finished_facade_count


def build_item_rows(run: Run, block: StoredBlock) -> ItemRows:
    """Build the rows of the item table from the units of a block."""
    return ItemRows(_facade_rows(run, block), _unusable_rows(run, block))


def write_masked_regions(path: Path, records: Sequence[FacadeRecord | None]) -> None:
    """Write the occluded regions of facades as JSON: source, and boxes (x0, y0, x1, y1) in texels of the facade."""
    regions = [
        {"facade": record["unit"], "source": record["source"], "boxes": record["masked"]}
        for record in records
        if record and record.get("masked")
    ]
    path.write_text(json.dumps(regions, indent=1))


def write_summary(path: Path, block: StoredBlock, rows: ItemRows) -> JsonObject:
    """Write the summary of a block as JSON, and return it."""
    summary: JsonObject = {
        "block": block.group.attrs["block"],
        "facades_done": rows.finished_facade_count,
        "facades_failed": rows.unfinished_facade_count,
        "viewpoints": len(block.plan.viewpoints),
        "atlas_digest": atlas_digest(block.group),
        "not_looked_at": _count_unchecked(block),
    }
    path.write_text(json.dumps(summary, indent=1))
    return summary


def _count_unchecked(block: StoredBlock) -> int:
    """Count facades from pictures, and exemplars, made without a detector for faces and number plates."""
    records = [*block.records, *block.journals["exemplars"]]
    return sum(record.get("looked") is False for record in records if record)


def _facade_rows(run: Run, block: StoredBlock) -> list[ItemRow]:
    """Build a row per facade; a facade without a record counts as failed at ingestion."""
    facades, charts = block.plan.facades, block.plan.scene.charts
    start = charts.origin[facades.chart, :2]
    end = start + charts.axis_u[facades.chart, :2] * charts.size[facades.chart, :1]
    lines, normals = np.stack([start, end], axis=1), charts.normals()[facades.chart]
    poses = _refined_pose_accuracy(block)
    rows = []
    for index, building in enumerate(facades.building.tolist()):
        street = block.plan.streets[int(facades.street[index])]
        record = block.records[index] or FacadeRecord(unit="", key="", status="failed", reason="not processed")
        source = FacadeSource(
            block=run.block,
            facades=facades,
            index=index,
            role=WALL_ROLES[int(facades.role[index])],
            buildings=block.buildings,
            street=street.name or street.id,
            street_id=street.id,
            line=lines[index],
            azimuth_deg=float(np.degrees(np.arctan2(normals[index, 0], normals[index, 1])) % 360),
            record=record,
            is_building_corrected=block.buildings["id"][building] in block.hand_corrected_ids,
            updated=record_finish_time(record) or block.ingest_time,
            poses=poses,
            code_version=block.version,
            config_digest=run.key,
        )
        rows.append(build_item_row(source))
    return rows


def pose_height_change(record: PoseRecord, stated: Pose) -> float:
    """Return the refined minus the stated height of a panorama, metres."""
    return round(record["pose"][2] - cast(float, stated.z), 3)


def _refined_pose_accuracy(block: StoredBlock) -> dict[str, PanoramaPose]:
    """Return the accuracy of refined poses by panorama."""
    return {
        record["unit"]: PanoramaPose(
            record.get("residual_deg"), record.get("apart_m"), pose_height_change(record, stated)
        )
        for record, stated in zip(block.refined_poses, block.plan.poses, strict=True)
        if record and record["status"] == "done"
    }


def record_finish_time(record: Record | None) -> datetime | None:
    """Return when the unit of a journal record was finished; None if unknown."""
    if record is None or "started" not in record:
        return None
    return datetime.fromtimestamp(record["started"] + sum(record.get("seconds", {}).values()), UTC)


def _unusable_rows(run: Run, block: StoredBlock) -> list[ItemRow]:
    known: ItemRow = {
        "block": run.block,
        "code_version": block.version,
        "config_digest": run.key,
        "updated": block.ingest_time,
    }
    aside = [(*one, set_aside_status(one[0])) for one in block.group.attrs["set_aside"]]
    return [
        dict.fromkeys(ROW_KEYS) | known | {"id": unit, "kind": kind, "reason": reason, "status": status}
        for kind, unit, reason, status in [*aside, *_unfinished_units(block)]
    ]


def _unfinished_units(block: StoredBlock) -> Iterator[tuple[str, str, str, str]]:
    """Yield kind, id, reason and status of units other than facades that failed or are stale."""
    for kind in STAGES_IN_ORDER:
        if kind.inputs is None or kind is FACADES:  # facades have rows of their own
            continue
        for record in block.records_by_stage[kind.stage]:
            if record and record["status"] == "failed":
                yield kind.subject, record["unit"], record["reason"], "failed"
    for record in block.journals["streets"]:
        if record and record["status"] in ("stale", "failed"):
            stale = "stale: " if record["status"] == "stale" else ""
            yield "street", record["unit"], f"{stale}{record['reason']}", "failed"
