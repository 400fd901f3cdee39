"""0017: a question to one parquet file through DuckDB, and to a folder of STAC-like items."""

from __future__ import annotations

import json
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import bytes_in, figures, seconds
from catalogs.published.items import ROW_KEYS, write_items
from catalogs.query import query

WHERE = "floors >= 6 and occluded > 0.4"
EAST, NORTH = 385_700.0, 6_671_700.0  # central Helsinki, EPSG:32635
SIDE_M = 2000.0
NOW = datetime(2024, 1, 1, tzinfo=UTC)


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Seconds of one query with a condition and a box, by number of facades: as shipped, and reading every item's JSON."""
    counts, repeats = ((50,), 1) if quick else ((1_000, 100_000), 5)
    return {"where": WHERE, "rows": {str(n): _figures(n, repeats) for n in counts}}


def _figures(count: int, repeats: int) -> dict[str, Any]:
    import duckdb

    rows = _rows(count)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        published = out / "published" / "s"
        published.mkdir(parents=True)
        write_items(published / "items.parquet", rows, "EPSG:32635")
        (out / "current").write_text("s\n")
        everything = query(out)
        box = [
            float(np.quantile(everything[side], q))
            for side, q in zip(("xmin", "ymin", "xmax", "ymax"), (0.4, 0.4, 0.6, 0.6), strict=True)
        ]
        items = out / "items"
        _write_json(items, everything)
        found = query(out, where=WHERE, bbox=box)
        reading = seconds(lambda: _read_json(items, box), min(repeats, 2))
        if sorted(found["id"]) != sorted(_read_json(items, box)):
            raise SystemExit("the two catalogues answer differently")
        asking = seconds(lambda: query(out, where=WHERE, bbox=box), repeats)
        inside = f"xmax >= {box[0]} and ymax >= {box[1]} and xmin <= {box[2]} and ymin <= {box[3]}"
        sql = f"SELECT * FROM '{published / 'items.parquet'}' WHERE {inside} AND {WHERE}"
        with duckdb.connect(":memory:") as connection:
            bare = seconds(lambda: connection.sql(sql).fetchall(), repeats)
        return {
            "found": len(found),
            "query_seconds": figures(asking),
            "duckdb_on_the_file_seconds": figures(bare),
            "item_files_seconds": figures(reading),
            "item_files_over_query": figures(reading / asking),
            "parquet_mb": figures((published / "items.parquet").stat().st_size / 1e6),
            "item_files_mb": figures(bytes_in(items) / 1e6),
        }


def _rows(count: int) -> list[dict[str, Any]]:
    from shapely import LineString

    rng = np.random.default_rng(0)
    x, y = EAST + rng.uniform(0, SIDE_M, count), NORTH + rng.uniform(0, SIDE_M, count)
    floors, hidden = rng.integers(1, 9, count), rng.uniform(0, 0.5, count)
    same = {
        "kind": "facade",
        "block": "b",
        "status": "done",
        "code_version": "1",
        "config_digest": "ab",
        "updated": NOW,
    }
    rows = []
    for i in range(count):
        own = {
            "id": f"w{i // 4}-f{i % 4}",
            "building": f"w{i // 4}",
            "geometry": LineString([(x[i], y[i]), (x[i] + 15, y[i])]),
            "street": f"Street {i % 97}",
            "floors": int(floors[i]),
            "height_m": 3.2 * int(floors[i]),
            "occluded": float(hidden[i]),
        }
        rows.append({key: (same | own).get(key) for key in ROW_KEYS})
    return rows


def _write_json(folder: Path, items: Any) -> None:
    """One GeoJSON feature per row with STAC's members, a folder per thousand."""
    for index, row in enumerate(items.drop(columns="geometry").astype(object).to_dict("records")):
        box = [row.pop(side) for side in ("xmin", "ymin", "xmax", "ymax")]
        properties = {name: value for name, value in row.items() if value is not None and value == value}
        item = {
            "type": "Feature",
            "stac_version": "1.1.0",
            "id": row["id"],
            "bbox": box,
            "geometry": {"type": "LineString", "coordinates": [box[:2], box[2:]]},
            "properties": {"datetime": "2024-01-01T00:00:00Z", **properties},
            "links": [{"rel": name, "href": f"../{name}.json"} for name in ("root", "parent", "collection")],
            "assets": {"texture": {"href": f"../textures/{row['id']}.png", "type": "image/png"}},
        }
        path = folder / str(index // 1000) / f"{row['id']}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(item, default=str), encoding="utf-8")


def _read_json(folder: Path, box: list[float]) -> list[str]:
    """Ids of the items that answer WHERE within the box."""
    found = []
    for path in folder.rglob("*.json"):
        item = json.loads(path.read_bytes())
        west, south, east, north = item["bbox"]
        inside = east >= box[0] and north >= box[1] and west <= box[2] and south <= box[3]
        values = item["properties"]
        if inside and values["floors"] >= 6 and values["occluded"] > 0.4:
            found.append(item["id"])
    return found
