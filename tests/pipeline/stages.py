"""A very small block, and its stages one after the other in this process, without a server or a cluster."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
import zarr
from joblib import hash as digest_of
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar_set
from catalogs.block.reader import read_block
from facade_core.atlas.journal import atlas_digest, latest_chart_digests, read_journal
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_repository, open_root
from facade_core.facade.exemplar import Exemplar, prepare_exemplar
from facade_core.plan.plan_tables import read_plan
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.fan_out import process_batch
from tasks.engine.forecast import forecast_work
from tasks.engine.outcome import UnitOutcomeCounts, list_units_with_rejections
from tasks.engine.pending import PendingUnits, find_pending_units
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.stages.ingest.task import ingest_block
from tasks.stages.order import STAGE_NAMES, STAGES_IN_ORDER
from tests.pipeline.small_views import VIEW_SIZE

EAST, NORTH = 385_000.0, 6_671_000.0
# South-western corner, width along x, depth along y, height of each building, so thin that only the side at the street is a
# facade; two beside each of the parallel streets, one beyond the crossing.
BUILDINGS: dict[str, tuple[float, ...]] = {
    "a": (4, 5, 12, 2.8, 7.0),
    "b": (24, -8, 12, 2.8, 9.0),
    "c": (4, 605, 12, 2.8, 7.0),
    "d": (24, 592, 12, 2.8, 9.0),
    "e": (50, 6, 2.8, 12, 7.0),
}
# Two streets that cross, and one so far away that no pixel shows it from there.
STREETS = {"1": [(0, 0), (45, 0)], "2": [(40, -15), (40, 25)], "3": [(0, 600), (45, 600)]}
SETTINGS = {"texels_per_metre": 3, "visibility_range": 25.0, "viewpoint_spacing": 9.0, "panorama_width": 128}


def write_block(
    folder: Path,
    *,
    buildings: Mapping[str, Sequence[float]] | None = None,
    streets: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    **keys: Any,
) -> Path:
    """Write or change the block in a folder; `keys` are those of the block file, texture's merged with SETTINGS."""
    folder.mkdir(parents=True, exist_ok=True)
    shapes = []
    for name, (x, y, width, depth, height) in (buildings or BUILDINGS).items():
        ring = [(x, y), (x + width, y), (x + width, y + depth), (x, y + depth), (x, y)]
        properties = {"id": name, "height": height, "roof:shape": "flat"}
        shapes.append(_feature("Polygon", [[_place(p) for p in ring]], **properties))
    lines = [
        _feature("LineString", [_place(p) for p in line], id=name, name=f"street {name}")
        for name, line in (streets or STREETS).items()
    ]
    for name, features in (("buildings", shapes), ("streets", lines)):
        collection = {"type": "FeatureCollection", "features": features}
        (folder / f"{name}.geojson").write_text(json.dumps(collection))
    texture = SETTINGS | keys.get("texture", {})
    imagery = {name: {"path": name} for name in ("photos",) if (folder / name).is_dir()}
    if texture.get("walls") != "translate":
        imagery["exemplars"] = {"path": "exemplars"}
    if "exemplars" in imagery and not (folder / "exemplars").is_dir():
        (folder / "exemplars").mkdir()
        for number, painted in enumerate(paint_exemplar_set(2, seed=5, metres_per_pixel=0.2)):
            Image.fromarray(painted.image).save(folder / "exemplars" / f"{number}.png")
    block = {
        "name": "small",
        "crs": "EPSG:32635",
        "buildings": {"path": "buildings.geojson", "crs": "EPSG:32635"},
        "streets": {"path": "streets.geojson", "crs": "EPSG:32635"},
        "imagery": imagery,
        "seed": 3,
        **keys,
        "texture": texture,
    }
    (folder / "block.yaml").write_text(yaml.safe_dump(block))
    return folder / "block.yaml"


def write_photo(folder: Path, facade: str, seed: int) -> None:
    """A photo for a facade; the block is to be written after the first."""
    (folder / "photos").mkdir(parents=True, exist_ok=True)
    painted = paint_exemplar_set(seed + 1, seed=seed, metres_per_pixel=0.2)[seed]
    Image.fromarray(painted.image).save(folder / "photos" / f"{facade}.png")


@dataclass(frozen=True)
class Textured:
    """A block whose stages have run, what was said before of those that were due again, and the units whose pictures were
    refused, with the reason."""

    run: Run
    said: str | None
    refused: tuple[tuple[str, str], ...]


# Exemplars that this process has prepared, by all that they were made of: one takes as long as a street, and tests texture
# blocks with the same ones again and again.
_prepared: dict[str, Exemplar] = {}


def _prepare_once(image: np.ndarray, hidden: np.ndarray, **more: Any) -> Exemplar:
    key = digest_of((image, hidden, more))
    if key not in _prepared:
        _prepared[key] = prepare_exemplar(image, hidden, **more)
    return deepcopy(_prepared[key])


@contextmanager
def sooner() -> Iterator[None]:
    """Stages in this process take less time: small views, and no exemplar prepared twice."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("facade_core.export.pictures.views.VIEW_SIZE", VIEW_SIZE)
        patch.setattr("tasks.stages.exemplars.worker.prepare_exemplar", _prepare_once)
        yield


def texture(block_file: Path, out: Path, *, stop_before: str = "") -> Textured:
    """All stages of a block but publishing, one unit at a time; or those before a stage."""
    out.mkdir(parents=True, exist_ok=True)
    block, compute = read_block(block_file), SerialCompute()
    run = create_run(block, out)
    outline = ingest_block.fn(run, block)
    run = replace(run, ingested=outline.ingested)
    said, outcome = forecast_work(run, block, outline).said, UnitOutcomeCounts()
    for kind in STAGES_IN_ORDER:
        if kind.stage == stop_before:
            break
        with sooner():
            outcome += _do(run, find_pending_units(run, block, kind), compute)
    return Textured(run, said, outcome.refused)


def started(out: Path) -> dict[tuple[str, str], float]:
    """When each unit that is done was begun, by stage and name."""
    group = _group(out)
    return {(stage, r["unit"]): r["started"] for stage in STAGE_NAMES for r in read_journal(group, stage) if r}


def redone(before: dict[tuple[str, str], float], out: Path) -> set[tuple[str, str]]:
    """The units that were done since."""
    return {unit for unit, at in started(out).items() if before.get(unit) != at}


def charts_of(run: Run) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Colour and provenance of every chart, by its id, as they lie in the store."""
    session = open_repository(run.store).readonly_session("main")
    group = open_root(session)
    plan = read_plan(session)
    placement = plan.scene.placement
    found = {}
    for chart, number in enumerate(plan.ids.tolist()):
        one = TexelLayout.of_charts(placement, [chart])
        colour, provenance = (read_rasters(group[f"atlas/{name}"], placement, one) for name in ("colour", "provenance"))
        found[f"{number:016x}"] = (colour, provenance)
    return found


def digests_of(out: Path) -> tuple[str, dict[str, str]]:
    """The digest of the atlas and those of its charts, from the journal."""
    group = _group(out)
    return atlas_digest(group), latest_chart_digests(read_journal(group, "surfaces"))


def stored_view(group: Any) -> str:
    """The path of what the first viewpoint decided that shows pictured ground."""
    return next(path for record in read_journal(group, "streets") if record for path in record.get("files", ()))


def _do(run: Run, due: PendingUnits, compute: SerialCompute) -> UnitOutcomeCounts:
    outcome = UnitOutcomeCounts(refused=list_units_with_rejections(due.done))
    if due.pieces:
        outcome += process_batch.fn(run, due.stage.stage, "1", due.stage.function, due.pieces, compute)
    assert not outcome.failed, outcome.failed
    return outcome


def _group(out: Path) -> Any:
    return zarr.open_group(open_repository(out / "store").readonly_session("main").store, mode="r")


def _place(point: tuple[float, float]) -> list[float]:
    return [EAST + point[0], NORTH + point[1]]


def _feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}
