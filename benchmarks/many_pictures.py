"""Time and memory of choosing and refining the perspective pictures of a block: `python -m benchmarks.many_pictures`.

Prints one JSON object. A painted street, and along it so many pictures of 12 megapixels of both sides, with poses .1 m and .5
degrees off. chosen: pictures that surfaces are taken from. seconds: read, headers and poses; plan, the block without pictures;
show, which picture shows which facade; choose. memory_mb: peak of the process after reading and after choosing, MB. With
--refine the chosen pictures are painted, the others are headers. refined: a run's ingest, with all of the above, and its stages
poses and bundles, one unit after the other.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely

from benchmarks.mesh_texturing.cases import LENS_DISTORTION, LENS_FOCAL_WIDTHS, PICTURE_NOISE_DEG, PICTURE_NOISE_M
from benchmarks.painter.street_truth import STREET_ORIGIN_M, SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.types import Lens, Pose
from facade_core.geometry.charts import CORNER_SHARES, ChartKind
from tasks.engine.compute.worker_setup import limit_threads

COUNTS = (300, 1000, 3000)
SEED = 3
# Size of a picture, and the width at which it is painted, pixels.
SIZE, PAINTED_WIDTH = (4000, 3000), 1000
CRS = "EPSG:32635"
# Place of the street in the grid of CRS, metres.
PLACE_M = np.array([385_000.0, 6_671_000.0])
STAGES = ("poses", "bundles")
COLUMNS = ("file", "x", "y", "z", "heading", "pitch", "roll", "focal_px", "cx", "cy", "k1", "k2", "width", "height")


def measure(count: int, buildings: int, *, is_refined: bool) -> dict[str, Any]:
    """Measure one number of pictures."""
    street = synthetic_street(buildings, seed=SEED)
    poses = place_cameras(street, count)
    with tempfile.TemporaryDirectory(prefix="many-pictures-") as name:
        folder = Path(name)
        block = write_street_block(folder, street, poses)
        result = _run_part("choose", block)
        chosen = result.pop("names")
        if not is_refined:
            return result
        for picture in chosen:
            image = render_street_panorama(street, poses[int(picture)], PAINTED_WIDTH, seed=int(picture))
            path = folder / "pictures" / f"{picture}.jpg"
            path.unlink()
            cv2.imwrite(str(path), cv2.resize(image, SIZE, interpolation=cv2.INTER_CUBIC)[..., ::-1])
        return result | {"refined": _run_part("refine", block)}


def place_cameras(street: SyntheticStreet, count: int) -> list[Pose]:
    """Return cameras along both sides of a street, each towards the other side."""
    width, height = SIZE
    lens = Lens(SIZE, (LENS_FOCAL_WIDTHS * width,) * 2, (width / 2, height / 2), LENS_DISTORTION)
    rng = np.random.default_rng(SEED)
    poses = []
    for number in range(count):
        side = 1 if number % 2 else -1
        x, y = street.world_point((number + 0.5) / count * street.length, -3.0 * side).tolist()
        ahead = street.axis[::-1] * [-1, 1] * side
        heading = float(np.degrees(np.arctan2(*ahead)) + rng.uniform(-35, 35))
        pitch, roll = float(rng.uniform(-6, 14)), float(rng.normal(0, 1))
        poses.append(Pose(x, y, float(rng.uniform(1.6, 2.6)), heading, pitch, roll, lens=lens))
    return poses


def write_street_block(folder: Path, street: SyntheticStreet, poses: list[Pose]) -> Path:
    """Write a street as a block with cameras that are off, and pictures that are headers."""
    charts = street.scene.charts
    houses = []
    for roof in np.flatnonzero(charts.kind == ChartKind.ROOF).tolist():
        corners = charts.points_at_shares(np.array([roof]), CORNER_SHARES)[0]
        ring = shapely.convex_hull(shapely.multipoints(_place(corners[:, :2])))
        houses.append(
            _feature(ring, id=str(charts.building[roof]), height=float(corners[0, 2]), **{"roof:shape": "flat"})
        )
    line = shapely.LineString(_place(np.array([street.world_point(0, 0), street.world_point(street.length, 0)])))
    for name, features in (("buildings", houses), ("streets", [_feature(line, id="1", name="street")])):
        (folder / f"{name}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    (folder / "exemplars").mkdir()
    cv2.imwrite(str(folder / "exemplars" / "facade.png"), street.facades[0].image[..., ::-1])
    _write_cameras(folder, poses)
    blank = folder / "blank.jpg"
    cv2.imwrite(str(blank), np.full((*SIZE[::-1], 3), 128, np.uint8))
    (folder / "pictures").mkdir()
    for number in range(len(poses)):
        (folder / "pictures" / f"{number:04}.jpg").hardlink_to(blank)
    block = {
        "name": "street",
        "crs": CRS,
        "buildings": {"path": "buildings.geojson", "crs": CRS},
        "streets": {"path": "streets.geojson", "crs": CRS},
        "imagery": {
            "exemplars": {"path": "exemplars"},
            "cameras": {"path": "pictures", "poses": "cameras.csv", "crs": CRS},
        },
    }
    (folder / "block.yaml").write_text(json.dumps(block))  # JSON is YAML
    return folder / "block.yaml"


def _write_cameras(folder: Path, poses: list[Pose]) -> None:
    rng = np.random.default_rng([SEED, 1])
    with (folder / "cameras.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for number, pose in enumerate(poses):
            step, turn = (one / np.linalg.norm(one) for one in rng.normal(0, 1, (2, 3)))
            off = [*(PICTURE_NOISE_M * step), *(PICTURE_NOISE_DEG * turn)]
            place = [*_place(np.array([pose.x, pose.y])), pose.z, pose.heading, pose.pitch, pose.roll]
            lens = pose.lens
            assert lens is not None
            row = [a + b for a, b in zip(place, off, strict=True)]
            rows.writerow([f"{number:04}.jpg", *row, lens.focal[0], *lens.centre, *lens.radial, *lens.size])


def _place(points: np.ndarray) -> np.ndarray:
    return np.asarray(points - STREET_ORIGIN_M + PLACE_M)


def _feature(shape: shapely.Geometry, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": shapely.geometry.mapping(shape)}


def _run_part(part: str, block: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.many_pictures", "--part", part, "--block", str(block)]
    return dict(json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout))


def choose(block_file: Path) -> dict[str, Any]:
    """Read a block and choose its pictures, as a run does."""
    from catalogs.block.reader import read_block
    from tasks.stages.ingest.planning import make_plan, update_plan_panoramas
    from tasks.stages.shared.picture_choice import choose_pictures

    times = [time.monotonic()]
    block = read_block(block_file)
    times.append(time.monotonic())
    read_mb = peak_mb()
    bare = make_plan(replace(block, panoramas=()))
    times.append(time.monotonic())
    plan = update_plan_panoramas(block, bare)
    times.append(time.monotonic())
    chosen = sorted(choose_pictures(plan, block))
    times.append(time.monotonic())
    seconds = dict(zip(("read", "plan", "show", "choose"), np.diff(times).round(1).tolist(), strict=True))
    return {
        "facades": len(plan.facades),
        "chosen": len(chosen),
        "seconds": seconds,
        "memory_mb": {"read": read_mb, "choose": peak_mb()},
        "names": [block.panoramas[index].id for index in chosen],
    }


def refine(block_file: Path) -> dict[str, Any]:
    """Refine the chosen pictures of a block by the stages of a run."""
    from catalogs.block.reader import read_block
    from tasks.engine.compute.serial import SerialCompute
    from tasks.engine.fan_out import process_batch
    from tasks.engine.pending import find_pending_units
    from tasks.engine.run_key import create_run
    from tasks.stages.ingest.task import ingest_block
    from tasks.stages.order import STAGES_IN_ORDER

    block = read_block(block_file)
    run = create_run(block, block_file.parent / "out")
    begun = time.monotonic()
    run = replace(run, ingested=ingest_block.fn(run, block).ingested)
    seconds = {"ingest": round(time.monotonic() - begun, 1)}
    for stage in STAGES_IN_ORDER:
        if stage.stage in STAGES and stage.inputs is not None:
            start = time.monotonic()
            due = find_pending_units(run, block, stage)
            process_batch.fn(run, stage.stage, "1", stage.function, due.pieces, SerialCompute())
            seconds[stage.stage] = round(time.monotonic() - start, 1)
    return {"seconds": seconds, "memory_mb": peak_mb()}


def peak_mb() -> int:
    """Return the peak memory of this process, MB."""
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS), help="numbers of pictures")
    parser.add_argument("--buildings", type=int, default=12, help="houses on the street, an even number")
    parser.add_argument("--refine", action="store_true", help="refine the chosen pictures, which takes minutes")
    parser.add_argument("--part", choices=("choose", "refine"), help=argparse.SUPPRESS)
    parser.add_argument("--block", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    limit_threads()
    if options.part:
        print(json.dumps({"choose": choose, "refine": refine}[options.part](options.block)))
        return
    result = {str(count): measure(count, options.buildings, is_refined=options.refine) for count in options.counts}
    print(json.dumps({"benchmark": "many_pictures", "buildings": options.buildings, "counts": result}, indent=1))


if __name__ == "__main__":
    main()
