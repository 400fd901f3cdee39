"""Rows of the item table and report: facades, and units that could not be used."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from typing import cast

import numpy as np

from catalogs.published.item_row import ItemRow
from catalogs.published.items import ASSUMED_HEIGHT, ROW_KEYS
from facade_core.atlas.journal import Record, atlas_digest
from facade_core.atlas.table_schema import TableValues
from facade_core.core.json_types import JsonObject
from facade_core.core.provenance import PROVENANCE, Provenance
from facade_core.core.types import Pose
from facade_core.geometry.walls import WALL_ROLES, WallRole
from facade_core.plan.facades import Facades
from tasks.engine.run import Run
from tasks.publish.stored_block import StoredBlock
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.order import FACADES, STAGES_IN_ORDER
from tasks.stages.poses.record import PoseRecord

# A facade with a larger hidden share needs review.
MAX_GOOD_HIDDEN_SHARE = 0.5
# A facade whose elements have a lower mean confidence needs review.
MIN_GOOD_CONFIDENCE = 0.5
# Ratio of the proportions of a photo and its wall beyond which the facade needs review: windows look squeezed.
MAX_STRETCH = 1.5


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
        "viewpoints": len(block.journals["viewpoints"]),
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
    from shapely import LineString

    plan, buildings = block.plan, block.buildings
    facades, charts = plan.facades, plan.scene.charts
    posed = _panorama_pose_columns(block)
    rows = []
    for index, name in enumerate(facades.id):
        chart = int(facades.chart[index])
        start = charts.origin[chart, :2]
        end = start + charts.axis_u[chart, :2] * charts.size[chart, 0]
        normal = charts.normals()[chart]
        building = int(facades.building[index])
        record = block.records[index] or FacadeRecord(unit=name, key="", status="failed", reason="not processed")
        street = plan.streets[int(facades.street[index])]
        # write_items checks every key and type
        row: dict[str, object] = {
            "id": name,
            "kind": "facade",
            "block": run.block,
            "building": buildings["id"][building],
            "part_of": (buildings["part_of"][building] or None) if "part_of" in buildings else None,
            "geometry": LineString([start, end]),
            "street": street.name or street.id,
            **_roof_columns(buildings, building),
            "azimuth_deg": round(float(np.degrees(np.arctan2(normal[0], normal[1])) % 360), 2),
            **facade_item_columns(facades, index, record, buildings["height_source"][building]),
            **_facade_pose_columns(record, posed),
            "corrected": int(bool(record.get("corrected")) or buildings["id"][building] in block.hand_corrected_ids),
            "parents": _parent_ids(run.block, buildings["id"][building], street.id, record),
            "updated": record_finish_time(record) or block.ingest_time,
            "status": record["status"],
            "reason": record.get("reason"),
            "code_version": block.version,
            "config_digest": run.key,
        }
        rows.append(cast(ItemRow, row))
    return rows


def pose_height_change(record: PoseRecord, stated: Pose) -> float:
    """Return the refined minus the stated height of a panorama, metres."""
    return round(record["pose"][2] - cast(float, stated.z), 3)


def _panorama_pose_columns(block: StoredBlock) -> dict[str, dict[str, float | None]]:
    """Return the pose columns of refined panoramas by name."""
    return {
        record["unit"]: {
            "pose_residual_deg": record.get("residual_deg"),
            "pose_apart_m": record.get("apart_m"),
            "pose_raised_m": pose_height_change(record, stated),
        }
        for record, stated in zip(block.refined_poses, block.plan.poses, strict=True)
        if record and record["status"] == "done"
    }


def _facade_pose_columns(
    record: FacadeRecord, posed: Mapping[str, Mapping[str, float | None]]
) -> dict[str, float | None]:
    """Return per pose column the value of largest magnitude among the panoramas of a facade; None if none has it."""
    parts = (record.get("source") or "").split(", ")
    # the name of a panorama may contain a comma
    runs = (", ".join(parts[i:j]) for i, j in combinations(range(len(parts) + 1), 2))
    sources = [posed[name] for name in runs if name in posed]
    found: dict[str, float | None] = {}
    for column in ("pose_residual_deg", "pose_apart_m", "pose_raised_m"):
        known = (value for source in sources if (value := source[column]) is not None)
        found[column] = max(known, key=abs, default=None)
    return found


def _roof_columns(buildings: TableValues, building: int) -> dict[str, object]:
    """Return the roof columns of a building; None for one with a roof from a model."""
    shape = buildings["roof_shape"][building]
    if not shape:
        return {"roof_shape": None, "roof_height_m": None, "roof_confidence": None}
    height, confidence = (round(float(buildings[name][building]), 3) for name in ("roof_height", "roof_confidence"))
    return {"roof_shape": shape, "roof_height_m": height, "roof_confidence": confidence}


def facade_item_columns(
    facades: Facades, index: int, record: FacadeRecord | None, height_source: str
) -> dict[str, object]:
    """Return the item-table columns of a facade that come from plan and journal record.

    Parameters
    ----------
    facades : facades of the plan.
    index : index of the facade.
    record : journal record of the facade, None without one; missing values become None.
    height_source : source of the height of its building.
    """
    record = record or cast(FacadeRecord, {})
    lattice, levels = record.get("lattice", {}), int(facades.floors[index])
    shares: Sequence[float | None] = record.get("provenance") or [None] * len(PROVENANCE)
    return {
        "role": WALL_ROLES[int(facades.role[index])],
        "height_m": round(float(facades.height[index]), 3),
        "width_m": round(float(facades.width[index]), 3),
        "floors": _count_shown_floors(record, levels, int(facades.role[index])),
        "levels": levels,
        **{key: record.get(key) for key in _RECORD_COLUMNS},
        "masked": record.get("masked_share"),
        **dict(zip(_SHARE_COLUMNS, shares[-len(_SHARE_COLUMNS) :], strict=True)),
        "lattice_rows": len(lattice["rows"]) if lattice else None,
        "lattice_columns": len(lattice["columns"]) if lattice else None,
        "quality": _quality_flags(record, levels, height_source, int(facades.role[index]))
        if "elements" in record
        else None,
        "seconds": round(sum(record.get("seconds", {}).values()), 4),
    }


def _count_shown_floors(record: FacadeRecord, levels: int, role: int) -> int:
    """Return the floors of a facade: of its picture, and of the map where that shows no windows.

    A back from an exemplar is composed with the floors of the map. Its one door is too small a share of a wide wall to
    mark the ground floor, which the count by rows of windows would then take for two.
    """
    is_composed_back = role != WallRole.STREET and "floors_low" not in record and not record.get("corrected")
    return levels if is_composed_back else record.get("floors") or levels


def _quality_flags(record: FacadeRecord, levels: int, height_source: str, role: int) -> str:
    """Return comma-separated reasons to review a facade; "good" if there are none."""
    elements, floors = record["elements"], record.get("floors", 0)
    # bounds of the estimate from pictures
    least, most = record.get("floors_low", floors), record.get("floors_high", floors)
    # height_source is "default" where the height was assumed
    flags = {
        "mostly-hidden": (record.get("occluded") or 0) > MAX_GOOD_HIDDEN_SHARE,
        "hidden-ground-floor": record.get("repeated_foot", 0) > 0,
        "no-windows": role == WallRole.STREET and not any(element[0] == "window" for element in elements),
        "unsure-parse": bool(elements) and float(np.mean([element[5] for element in elements])) < MIN_GOOD_CONFIDENCE,
        "floors-differ": role == WallRole.STREET and floors > 0 and not least <= levels <= most,
        "doubtful-cut": not record.get("cut_found", True)
        or not 1 / MAX_STRETCH <= record.get("stretched", 1.0) <= MAX_STRETCH,
        "rejected-picture": bool(record.get("reason")),
        ASSUMED_HEIGHT: height_source == "default",
    }
    return ", ".join(name for name, raised in flags.items() if raised) or "good"


def _parent_ids(block: str, building: str, street: str, record: FacadeRecord) -> str:
    images = [f"image/{name}" for name in (record.get("source") or "").split(", ") if name]
    return ", ".join([f"block/{block}", f"building/{building}", f"street/{street}", *images])


def record_finish_time(record: Record | None) -> datetime | None:
    """Return when the unit of a journal record was finished; None if unknown."""
    if record is None or "started" not in record:
        return None
    return datetime.fromtimestamp(record["started"] + sum(record.get("seconds", {}).values()), UTC)


def _unusable_rows(run: Run, block: StoredBlock) -> list[ItemRow]:
    known: dict[str, object] = {
        "block": run.block,
        "status": "failed",
        "code_version": block.version,
        "config_digest": run.key,
        "updated": block.ingest_time,
    }
    return [
        cast(ItemRow, dict.fromkeys(ROW_KEYS) | known | {"id": unit, "kind": kind, "reason": reason})
        for kind, unit, reason in _unusable_units(block)
    ]


def _unusable_units(block: StoredBlock) -> Iterator[tuple[str, str, str]]:
    """Yield kind, id and reason of units other than facades that failed or are stale."""
    yield from block.group.attrs["set_aside"]
    for kind in STAGES_IN_ORDER:
        if kind.units is None or kind is FACADES:  # facades have rows of their own
            continue
        for record in block.records_by_stage[kind.stage]:
            if record and record["status"] == "failed":
                yield kind.subject, record["unit"], record["reason"]
    for record in block.journals["streets"]:
        if record and record["status"] in ("stale", "failed"):
            stale = "stale: " if record["status"] == "stale" else ""
            yield "street", record["unit"], f"{stale}{record['reason']}"


# Only a failed facade has texels of plain material.
_SHARE_COLUMNS = PROVENANCE[Provenance.TRANSLATED :]
_RECORD_COLUMNS = (
    "columns",
    "windows",
    "doors",
    "balconies",
    "shops",
    "windows_low",
    "windows_high",
    "floors_low",
    "floors_high",
    "windows_seen",
    "doors_seen",
    "balconies_seen",
    "shops_seen",
    "shop_width",
    "window_to_wall",
    "window_to_wall_low",
    "window_to_wall_high",
    "occluded",
    "privacy",
    "shop_names",
    "source",
    "capture_date",
    "changed",
    "compared",
    "capture_date_before",
    "variation_types",
    "variation_levels",
    "variation_bytes",
    "layout_score",
)
