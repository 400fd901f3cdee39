"""What the catalogue and the report say and show of each facade."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.features import file_stem
from catalogs.published.items import ROW_KEYS
from facade_core.atlas.rasters import Rasters, read_rasters
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.export import draw_facade, overlay_hidden
from facade_core.facades import Facades
from facade_core.geometry.packing import Placement
from facade_core.plan import Plan
from facade_core.types import Lattice
from facade_core.variation import Hierarchy, draw_level
from tasks.run import Run

if TYPE_CHECKING:
    import xarray as xr

# Levels of the hierarchy that the report draws.
LEVELS_SHOWN = 3
# Sampled variations that the report draws.
SAMPLES_SHOWN = 3
# A facade of which more than this share was hidden, or of whose elements the parser was less sure on average, wants a look.
HIDDEN, SURE = 0.5, 0.5


def chart_raster(group: StoreGroup, placement: Placement, chart: int, name: str) -> np.ndarray:
    """The texels (h, w, ...) of a chart in an array of the store, such as facade_maps/labels."""
    flat = read_rasters(group[name], placement, Rasters.of(placement, [chart]))
    return flat.reshape(int(placement.height[chart]), int(placement.width[chart]), *flat.shape[1:])


def facade_sheets(group: StoreGroup, plan: Plan, records: Sequence[dict[str, Any] | None], folder: Path) -> None:
    """One WebP per facade and stage: evidence, hidden, parse with lattice, levels of the hierarchy, samples, the result."""
    for index, record in enumerate(records):
        if record is None or "lattice" not in record:
            continue
        chart = int(plan.facades.chart[index])

        def raster(name: str, chart: int = chart) -> np.ndarray:
            return chart_raster(group, plan.scene.placement, chart, name)

        lattice = Lattice(tuple(record["lattice"]["rows"]), tuple(record["lattice"]["columns"]))
        hierarchy = Hierarchy.from_bytes(base64.b64decode(group["hierarchies/data"][index].item()))
        stages = {
            "parse": draw_facade(raster("facade_maps/labels"), lattice),
            "result": raster("atlas/seed"),
        }
        for seed in range(SAMPLES_SHOWN):
            stages["sample" if seed == 0 else f"sample-{seed}"] = hierarchy.sample(len(hierarchy.levels) // 2, seed)
        hidden = raster("facade_maps/occluded")
        if hidden.any():
            stages["hidden"] = overlay_hidden(raster("facade_maps/evidence"), hidden)
        for level in shown_levels(len(hierarchy.levels)):
            stages[f"level-{level}"] = draw_level(hierarchy, level)
        for stage, image in stages.items():
            _save(folder / f"{file_stem(record['unit'])}-{stage}.webp", image)


def shown_levels(levels: int) -> list[int]:
    """The levels of a hierarchy that are drawn: the first, the last, and what fits between."""
    return sorted({round(i * (levels - 1) / max(1, LEVELS_SHOWN - 1)) for i in range(LEVELS_SHOWN)})


def item_rows(
    run: Run,
    plan: Plan,
    buildings: xr.Dataset,
    records: Sequence[dict[str, Any] | None],
    code_version: str,
    ingested: datetime,
) -> list[dict[str, Any]]:
    """One row per facade, in the order of the facades; a facade without a record counts as failed when it was ingested."""
    from shapely import LineString

    facades, charts = plan.facades, plan.scene.charts
    heights = list(map(str, buildings.height_source.values))
    rows = []
    for index, name in enumerate(facades.id):
        chart = int(facades.chart[index])
        start = charts.origin[chart, :2]
        end = start + charts.axis_u[chart, :2] * charts.size[chart, 0]
        normal = charts.normal()[chart]
        record = records[index] or {"status": "failed", "reason": "not processed"}
        street = plan.streets[int(facades.street[index])]
        rows.append(
            {
                "id": name,
                "kind": "facade",
                "block": run.block,
                "building": str(buildings.id.values[facades.building[index]]),
                "geometry": LineString([start, end]),
                "street": street.name or street.id,
                "azimuth_deg": round(float(np.degrees(np.arctan2(normal[0], normal[1])) % 360), 2),
                **facts(facades, index, record, heights[int(facades.building[index])]),
                "parents": _parents(run.block, str(buildings.id.values[facades.building[index]]), street.id, record),
                "updated": made_at(record) or ingested,
                "status": record["status"],
                "reason": record.get("reason"),
                "code_version": code_version,
                "config_digest": run.key,
            }
        )
    return rows


def facts(facades: Facades, index: int, record: Mapping[str, Any], height_source: str) -> dict[str, Any]:
    """The columns of a facade that come from its place in the plan, its journal record and where its building's height is from;
    None where the record has none."""
    lattice = record.get("lattice", {})
    return {
        "height_m": round(float(facades.height[index]), 3),
        "width_m": round(float(facades.width[index]), 3),
        "floors": int(facades.floors[index]),
        **{key: record.get(key) for key in _FROM_RECORD},
        "masked": len(record["masked"]) if "masked" in record else None,
        **dict(zip(_SHARES, (record.get("provenance") or [None] * 5)[1:], strict=True)),
        "lattice_rows": len(lattice["rows"]) if lattice else None,
        "lattice_columns": len(lattice["columns"]) if lattice else None,
        "quality": _quality(record, int(facades.floors[index]), height_source) if "elements" in record else None,
        "seconds": round(sum(record.get("seconds", {}).values()), 4),
    }


def _quality(record: Mapping[str, Any], floors: int, height_source: str) -> str:
    """What somebody should look at before using a facade, comma-separated; good where there is nothing."""
    elements = record["elements"]
    windows = np.array([element[1:5] for element in elements if element[0] == "window"], float).reshape(-1, 4)
    # height_source is "default" where the height was assumed
    flags = {
        "mostly-hidden": (record.get("occluded") or 0) > HIDDEN,
        "no-windows": not len(windows),
        "unsure-parse": bool(elements) and float(np.mean([element[5] for element in elements])) < SURE,
        "rows-differ": len(windows) > 0 and abs(_window_rows(windows) - floors) > 1,
        "height-assumed": height_source == "default",
    }
    return ", ".join(name for name, raised in flags.items() if raised) or "good"


def _window_rows(windows: np.ndarray) -> int:
    """How many rows the windows (n, 4) x0, y0, x1, y1 stand in: a row ends where the next window begins below its middle."""
    middle = np.sort((windows[:, 1] + windows[:, 3]) / 2)
    return 1 + int((np.diff(middle) > np.median(windows[:, 3] - windows[:, 1]) / 2).sum())


def _parents(block: str, building: str, street: str, record: Mapping[str, Any]) -> str:
    images = [f"image/{name}" for name in (record.get("source") or "").split(", ") if name]
    return ", ".join([f"block/{block}", f"building/{building}", f"street/{street}", *images])


def masked_regions(records: Sequence[dict[str, Any] | None]) -> list[dict[str, Any]]:
    """The facades whose imagery showed things in front: source, and boxes (x0, y0, x1, y1) in texels of the facade."""
    return [
        {"facade": record["unit"], "source": record["source"], "boxes": record["masked"]}
        for record in records
        if record and record.get("masked")
    ]


def made_at(record: Mapping[str, Any] | None) -> datetime | None:
    """When the unit of a journal record was finished."""
    if record is None or "started" not in record:
        return None
    return datetime.fromtimestamp(record["started"] + sum(record.get("seconds", {}).values()), UTC)


def set_aside_rows(
    run: Run, units: Sequence[tuple[str, str, str]], code_version: str, ingested: datetime
) -> list[dict[str, Any]]:
    """One row per unit (kind, id, reason) that is no facade and could not be used."""
    known = {
        "block": run.block,
        "status": "failed",
        "code_version": code_version,
        "config_digest": run.key,
        "updated": ingested,
    }
    return [
        dict.fromkeys(ROW_KEYS) | known | {"id": unit, "kind": kind, "reason": reason} for kind, unit, reason in units
    ]


_SHARES = ("translated", "synthesised", "inpainted", "photo")
_FROM_RECORD = (
    "columns",
    "windows",
    "doors",
    "balconies",
    "shops",
    "window_to_wall",
    "occluded",
    "source",
    "variation_types",
    "variation_levels",
    "variation_bytes",
    "layout_score",
)


def _save(path: Path, image: np.ndarray) -> None:
    from PIL import Image

    Image.fromarray(image).save(path, "WEBP", quality=82, method=2)
