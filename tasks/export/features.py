"""Feature table of a published block's model: facades from the catalogue, other parts from their building."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from catalogs.published.columns import COLUMNS, ItemColumn
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.export.models.features import FeatureTable, MetadataProperty
from facade_core.geometry.charts import CHART_KINDS
from tasks.publish.published_run import PublishedBlock

# The model has the foot line already.
OMITTED_COLUMNS = ("geometry",)
# Columns that other surfaces of a building inherit from its row, and sums over its facades in that row.
BUILDING_COLUMNS = tuple(column.name for column in COLUMNS if column.of_building == "same")
SUMMED_COLUMNS = tuple(column.name for column in COLUMNS if column.of_building == "sum")


def build_feature_table(results: PublishedBlock) -> FeatureTable:
    """Build a row for each facade, other building surface, ground tile and building."""
    charts, plan = results.plan.scene.charts, results.plan
    rows: list[JsonObject] = []
    catalogue = _read_facade_rows(results)
    facade_at = dict(zip(plan.facades.chart.tolist(), plan.facades.id, strict=True))
    of_chart, of_owner = (np.full(len(charts), -1, np.int64) for _ in range(2))

    def add(row: Mapping[str, object]) -> int:
        rows.append({"kind": None, "status": "done", **row})
        return len(rows) - 1

    facades_of: dict[str, list[JsonObject]] = {}
    for row in catalogue.values():
        facades_of.setdefault(row["building"], []).append(row)
    building_rows: dict[int, int] = {}
    shared: dict[tuple[int, int], int] = {}
    counts: dict[tuple[int, int], int] = {}
    for chart, (kind, building, surface) in enumerate(
        zip(charts.kind.tolist(), charts.building.tolist(), charts.surface.tolist(), strict=True)
    ):
        if building < 0:
            piece = {"id": f"ground-{chart}", "kind": CHART_KINDS[kind], "block": results.block}
            of_chart[chart] = of_owner[chart] = add(piece)
            continue
        if building not in building_rows:
            building_rows[building] = add(_building_row(results, building, facades_of.get(results.names[building], [])))
        of_owner[chart] = building_rows[building]
        if chart in facade_at and facade_at[chart] in catalogue:
            of_chart[chart] = add(catalogue[facade_at[chart]])
        elif (building, surface) in shared:
            of_chart[chart] = shared[building, surface]
        else:
            whole = rows[building_rows[building]]
            number = counts[building, kind] = counts.get((building, kind), -1) + 1
            part = {"id": f"{results.names[building]}-{CHART_KINDS[kind]}-{number}", "kind": CHART_KINDS[kind]}
            of_chart[chart] = add({name: whole.get(name) for name in BUILDING_COLUMNS} | part)
            shared[building, surface] = int(of_chart[chart])
    return FeatureTable(
        tuple(map(_property, (column for column in COLUMNS if column.name not in OMITTED_COLUMNS))),
        rows,
        of_chart,
        of_owner,
    )


def _read_facade_rows(results: PublishedBlock) -> dict[str, JsonObject]:
    """Read the rows of facades by id; columns that an older version did not publish are None."""
    names = [column.name for column in COLUMNS if column.name not in OMITTED_COLUMNS]
    try:
        held = pq.ParquetFile(io.BytesIO(results.snapshot.items.read_bytes()))
        table = held.read(columns=[name for name in names if name in held.schema_arrow.names])
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{results.snapshot.items}: {results.snapshot.remedy}") from error
    unknown = dict.fromkeys(names)
    rows = [
        unknown | row | {"updated": row["updated"].isoformat()} for row in table.to_pylist() if row["kind"] == "facade"
    ]
    return {row["id"]: row for row in rows}


def list_building_rows(results: PublishedBlock) -> dict[int, JsonObject]:
    """Return the row of each building by index, with the catalogue's columns."""
    rows_by_building: dict[str, list[JsonObject]] = {}
    for row in _read_facade_rows(results).values():
        rows_by_building.setdefault(row["building"], []).append(row)
    return {
        building: _building_row(results, building, rows_by_building.get(name, []))
        for building, name in results.names.items()
    }


def _property(column: ItemColumn) -> MetadataProperty:
    # times become ISO 8601 text; doubles hold the integers exactly, and scripts can add them up
    types = {"int64": "double", "timestamp[us, UTC]": "string"}
    return MetadataProperty(column.name, types.get(column.type, column.type), column.unit, column.meaning)


def _building_row(results: PublishedBlock, building: int, facades: list[JsonObject]) -> JsonObject:
    """Compose the row of a building from the plan and from sums over its facades."""
    table = {name: column[building] for name, column in results.buildings.items()}
    qualities = sorted({quality for row in facades for quality in str(row["quality"] or "").split(", ") if quality})
    floors = [row["floors"] for row in facades if row["floors"] is not None]
    sums = {
        name: sum(values)
        for name in SUMMED_COLUMNS
        if (values := [row[name] for row in facades if row[name] is not None])
    }
    return {
        "id": results.names[building],
        "kind": "building",
        "block": results.block,
        "building": results.names[building],
        "part_of": table.get("part_of") or None,
        "height_m": float(table["height"]),
        "levels": int(table["levels"]) or None,
        "roof_shape": table.get("roof_shape") or None,
        "roof_height_m": float(table["roof_height"]) if table.get("roof_shape") else None,
        "roof_confidence": float(table["roof_confidence"]) if "roof_confidence" in table else None,
        "floors": max(floors, default=None),
        # good if all facades are good, else the remarks on any of them
        "quality": ", ".join(quality for quality in qualities if quality != "good") or ("good" if qualities else None),
        **sums,
    }
