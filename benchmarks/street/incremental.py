"""What a change costs: a block is textured, one thing of it changed, and it is run again in the same folder and in a fresh one.

The block is made here: two rows of streets that cross, houses along them, painted exemplars, one photo. Each run is the command
`streetloom run`, published. Units are counted by the journal: those that were begun after the change.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from benchmarks.painter.exemplars import paint_exemplar_set
from benchmarks.process_usage import user_environment
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import STAGE_NAMES

CRS = "EPSG:3879"
EAST, NORTH = 25_496_000.0, 6_672_000.0
# Streets run this far apart in both directions; houses stand between them, this wide, their fronts this far from centrelines.
APART_M, HOUSE_M, FRONT_M, DEPTH_M = 72.0, 16.0, 8.0, 12.0
ROWS, COLUMNS = 3, 3
EXEMPLARS, DENSITY = 5, 10.0

Change = Callable[[Path, dict[str, Any]], None]


def measure(rows: int = ROWS, columns: int = COLUMNS) -> dict[str, Any]:
    """By kind of change: units done again by stage, seconds of that and of a fresh run, and whether both have one digest."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = write_block(folder / "first" / "in", rows, columns)
        summary = run_block(first, folder / "first" / "out")
        totals = Counter(stage for stage, _ in begun(folder / "first" / "out"))
        result: dict[str, Any] = {
            "units": dict(totals),
            "seconds_fresh": summary["seconds"],
            "load": round(os.getloadavg()[0], 1),
        }
        for kind, change in CHANGES.items():
            shutil.copytree(folder / "first", folder / kind)
            block = folder / kind / "in" / "block.yaml"
            keys = yaml.safe_load(block.read_text())
            change(folder / kind / "in", keys)
            block.write_text(yaml.safe_dump(keys))
            before = begun(folder / kind / "out")
            again = run_block(block, folder / kind / "out")
            after = begun(folder / kind / "out")
            fresh = run_block(block, folder / kind / "fresh")
            result[kind] = {
                "done_again": dict(
                    Counter(stage for (stage, unit), at in after.items() if before.get((stage, unit)) != at)
                ),
                "said": again["said"],
                "seconds": again["seconds"],
                "seconds_fresh": fresh["seconds"],
                "same_digest": again["atlas_digest"] == fresh["atlas_digest"],
            }
            shutil.rmtree(folder / kind)
        return result


def write_block(folder: Path, rows: int, columns: int) -> Path:
    """Input of the block into `folder`; returns its block file."""
    from PIL import Image

    folder.mkdir(parents=True)
    length, lines, houses = max(rows, columns) * APART_M, [], []
    for number in range(rows):
        lines.append(_feature("LineString", [[0, number * APART_M], [length, number * APART_M]], id=f"r{number}"))
        for house in range(int(length // HOUSE_M)):
            west, south = house * HOUSE_M, number * APART_M + FRONT_M
            if (west + HOUSE_M) % APART_M < HOUSE_M + FRONT_M or west % APART_M < FRONT_M:
                continue  # where a street crosses
            ring = [[west, south], [west + HOUSE_M, south], [west + HOUSE_M, south + DEPTH_M], [west, south + DEPTH_M]]
            height = 9.0 + 3.0 * ((house + number) % 3)
            houses.append(_feature("Polygon", [[*ring, ring[0]]], id=f"h{number}-{house}", height=height))
    for number in range(columns):
        lines.append(_feature("LineString", [[number * APART_M, 0], [number * APART_M, length]], id=f"c{number}"))
    _write(folder / "streets.geojson", lines)
    _write(folder / "buildings.geojson", houses)
    (folder / "exemplars").mkdir()
    for number, painted in enumerate(paint_exemplar_set(EXEMPLARS, seed=1, metres_per_pixel=1 / DENSITY)):
        Image.fromarray(painted.image).save(folder / "exemplars" / f"{number}.png")
    (folder / "photos").mkdir()
    shutil.copy(folder / "exemplars" / "0.png", folder / "photos" / f"{houses[1]['properties']['id']}-0.png")
    block = {
        "name": "changing",
        "crs": CRS,
        "buildings": {"path": "buildings.geojson", "crs": CRS},
        "streets": {"path": "streets.geojson", "crs": CRS},
        "imagery": {"exemplars": {"path": "exemplars"}, "photos": {"path": "photos"}},
        "texture": {"texels_per_metre": DENSITY},
        "seed": 1,
    }
    (folder / "block.yaml").write_text(yaml.safe_dump(block))
    return folder / "block.yaml"


def run_block(block: Path, out: Path) -> dict[str, Any]:
    """The summary of a run, and under "said" the line on what was due."""
    command = [sys.executable, "-m", "flows", "run", str(block), "--out", str(out), "--workers", "2", "--json"]
    done = subprocess.run(command, env=user_environment(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    said = [line for line in done.stderr.splitlines() if line.startswith("streetloom: due")]
    return json.loads(done.stdout.strip().splitlines()[-1]) | {"said": said[0] if said else ""}


def begun(out: Path) -> dict[tuple[str, str], float]:
    """When each unit was begun, by stage and name."""
    return {
        (stage, r["unit"]): r["started"]
        for stage in STAGE_NAMES
        for r in read_newest_journal(out / "store", stage)
        if r
    }


def _photo(folder: Path, keys: dict[str, Any]) -> None:
    (photo,) = (folder / "photos").iterdir()
    shutil.copy(folder / "exemplars" / "2.png", photo)


def _exemplar(folder: Path, keys: dict[str, Any]) -> None:
    from PIL import Image, ImageOps

    with Image.open(folder / "exemplars" / "1.png") as image:
        ImageOps.mirror(image).save(folder / "exemplars" / "1.png")


def _height(folder: Path, keys: dict[str, Any]) -> None:
    houses = _read(folder / "buildings.geojson")
    houses[len(houses) // 2]["properties"]["height"] += 3.0
    _write(folder / "buildings.geojson", houses)


def _removed(folder: Path, keys: dict[str, Any]) -> None:
    houses = _read(folder / "buildings.geojson")
    del houses[len(houses) // 2]
    _write(folder / "buildings.geojson", houses)


def _spacing(folder: Path, keys: dict[str, Any]) -> None:
    keys["texture"]["viewpoint_spacing"] = 6.0


def _density(folder: Path, keys: dict[str, Any]) -> None:
    keys["texture"]["texels_per_metre"] = DENSITY + 1


def _nothing(folder: Path, keys: dict[str, Any]) -> None:
    keys["geoid_separation"] = 17.0


CHANGES: dict[str, Change] = {
    "photo": _photo,
    "exemplar": _exemplar,
    "building_raised": _height,
    "building_removed": _removed,
    "viewpoint_spacing": _spacing,
    "texels_per_metre": _density,
    "geoid_separation": _nothing,
}


def _feature(kind: str, coordinates: list[Any], **properties: Any) -> dict[str, Any]:
    def moved(value: Any) -> Any:
        return [moved(one) for one in value] if isinstance(value[0], list) else [value[0] + EAST, value[1] + NORTH]

    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": moved(coordinates)}}


def _read(path: Path) -> list[dict[str, Any]]:
    return json.loads(path.read_text())["features"]


def _write(path: Path, features: list[dict[str, Any]]) -> None:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
