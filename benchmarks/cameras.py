"""Ground from posed panoramas: `python -m benchmarks.cameras` prints one JSON object; it needs no data.

A synthetic street whose ground is painted, with cut-outs of cars, trees and lamps before the houses, is seen by panoramas of
different exposure whose poses are off by 0.3 m and 1 degree and then refined, as a run does it. Over the texels of ground that
some camera shows, PSNR in dB with a factor per channel aside: of what a run finishes (`ours`), of each texel from the camera
that shows it best, as it is (`plain`), of the material alone, as without cameras (`material`). Apart: `seen`, what a camera
shows with nothing before it; `hidden`, behind cut-outs for every camera; `taken` from cameras; continued by `example`; the
`rest`, of material. through: of 10,000 texels taken those that show a cut-out instead of the ground, `plain` likewise.
exposure: what is left of the cameras' differences, as a ratio (1 is none). seconds: to look down, to mask and to take a
piece, a camera; to finish a piece.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely

from benchmarks.painter.street_paint import ground_pattern_painter
from benchmarks.painter.street_truth import (
    GroundPaint,
    SidePaint,
    SyntheticStreet,
    is_behind_cutout,
    render_street_panorama,
    synthetic_street,
)
from benchmarks.poses import refined_poses
from facade_core.atlas.surroundings import ChartReader
from facade_core.core.provenance import Provenance
from facade_core.core.types import Pose, Street
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.camera_view import FusedCameraView, PanoramaCamera
from facade_core.imagery.cameras.exposure import estimate_common_exposure, sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import mask_ground_occluders
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart

POSE_NOISE_M, POSE_NOISE_DEG = 0.3, 1.0
# Of the ground's texels; those of the walls stay.
DENSITY = 16.0


def measure(
    *, seed: int = 3, buildings: int = 8, cameras: int = 5, width: int = 4096, pictures: Path | None = None
) -> dict[str, Any]:
    """A street of so many houses and cameras; pictures: a folder for those of its ground."""
    street = synthetic_street(buildings, seed=seed)
    true, given, gains, images = photographed_street(
        street, cameras, width, seed, ground=ground_pattern_painter(street)
    )
    scene = finer_ground(street.scene)
    found: dict[str, Any] = {"benchmark": "cameras", "cameras": cameras, "texels_per_metre": DENSITY}
    for name, poses in (("given", given), ("refined", None), ("true", true)):
        found[name] = _recovered(
            scene,
            street,
            images,
            true,
            poses or refined(street.scene, images, given),
            gains,
            pictures and pictures / name,
        )
    return found


def photographed_street(
    street: SyntheticStreet, cameras: int, width: int, seed: int, *, ground: GroundPaint, sides: SidePaint | None = None
) -> tuple[list[Pose], list[Pose], list[float], list[np.ndarray]]:
    """So many cameras along a street: their true poses, those that are stated, their exposures and pictures."""
    rng = np.random.default_rng(seed)
    true, given, gains, images = [], [], [], []
    for number in range(cameras):
        x, y = street.world_point((number + 0.5) / cameras * street.length, (-1) ** number * 1.5)
        pose = Pose(float(x), float(y), 2.5, float(rng.uniform(0, 360)), *rng.normal(0, 0.5, 2).tolist())
        sideways, sign = rng.uniform(0, 2 * np.pi), rng.normal(0, 1, 3)
        true.append(pose)
        given.append(
            replace(
                pose,
                x=pose.x + POSE_NOISE_M * float(np.cos(sideways)),
                y=pose.y + POSE_NOISE_M * float(np.sin(sideways)),
                heading=pose.heading + POSE_NOISE_DEG * float(np.sign(sign[0])),
                pitch=pose.pitch + 0.3 * float(sign[1]),
                roll=pose.roll + 0.3 * float(sign[2]),
            )
        )
        gains.append(float(rng.uniform(0.7, 1.0)))
        images.append(
            render_street_panorama(street, pose, width, gain=gains[-1], seed=number, ground=ground, sides=sides)
        )
    return true, given, gains, images


def refined(scene: Scene, images: Sequence[np.ndarray], given: Sequence[Pose]) -> list[Pose]:
    return list(refined_poses(scene, images, given)["together"])


def finer_ground(scene: Scene) -> Scene:
    """The scene with its ground at DENSITY."""
    density = np.where(scene.charts.kind == ChartKind.GROUND, DENSITY, scene.placement.texels_per_metre)
    placement = pack_charts(scene.charts.size, density, scene.charts.building, page=2048, chunk=128, gutter=2)
    return replace(scene, placement=placement)


def _recovered(
    scene: Scene,
    street: SyntheticStreet,
    images: Sequence[np.ndarray],
    true: Sequence[Pose],
    poses: Sequence[Pose],
    gains: Sequence[float],
    pictures: Path | None,
) -> dict[str, Any]:
    paint = ground_pattern_painter(street)
    seconds: dict[str, list[float]] = {"look": [], "mask": [], "ground": [], "finish": []}
    cameras, squares = [], []
    for image, pose in zip(images, poses, strict=True):
        start = time.perf_counter()
        squares.append(sample_ground_colours(scene, image, pose).squares)
        looked = time.perf_counter()
        hidden = mask_ground_occluders(image, pose)
        seconds["look"].append(looked - start)
        seconds["mask"].append(time.perf_counter() - looked)
        cameras.append(PanoramaCamera(image, pose, hidden, np.ones(3), typical_ground_colour(squares[-1])))
    factor = estimate_common_exposure(squares).factors
    cameras = [replace(camera, exposure_factor=own) for camera, own in zip(cameras, factor, strict=True)]
    left = np.array(gains) * factor.mean(axis=1)
    street_line = Street(
        "street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)])
    )
    materials = MaterialField(scene, (street_line,), seed=1)
    grounds = np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist()
    shown: dict[int, FusedCameraView] = {}
    for chart in grounds:
        start = time.perf_counter()
        found = fuse_ground_view(scene, chart, cameras)
        seconds["ground"].append((time.perf_counter() - start) / len(cameras))
        if found is not None:
            shown[chart] = found
    known = KnownTexture(shown_reader(scene, shown), shown)
    parts: list[dict[str, np.ndarray]] = []
    for chart in grounds:
        size = scene.placement.shape(chart)
        views = [rectify_chart_from_panorama(scene, chart, c.image, c.pose, size) for c in cameras]
        points = ground_points(scene, chart, size)
        away = [np.hypot(points[..., 0] - c.pose.x, points[..., 1] - c.pose.y) for c in cameras]
        seen = np.stack([v.seen & (a <= GROUND_REACH_M) for v, a in zip(views, away, strict=True)])
        somewhere = np.asarray(seen.any(axis=0))
        if not somewhere.any():
            continue
        start = time.perf_counter()
        ours, provenance = finish_chart(scene, materials, chart, known)
        seconds["finish"].append(time.perf_counter() - start)
        best = np.where(seen, np.stack([v.quality for v in views]), -1).argmax(axis=0)
        covered = np.stack(
            [is_behind_cutout(street, points, a, assumed_pose=b) for a, b in zip(true, poses, strict=True)]
        )
        camera = shown[chart].camera if chart in shown else np.full(size, -1, np.int8)
        rasters = {
            "truth": paint(points.reshape(-1, 3)[:, :2]).reshape(points.shape),
            "ours": ours,
            "plain": np.stack([v.rgb for v in views])[best, *np.indices(size)],
            "material": materials.chart_raster(chart).reshape(*size, 3),
            "hidden": np.asarray(~(seen & ~covered).any(axis=0)),
            "taken": camera >= 0,
            "example": provenance == Provenance.INPAINTED,
            "plain through": np.take_along_axis(covered, best[None], axis=0)[0],
            "ours through": np.take_along_axis(covered, np.maximum(camera, 0)[None].astype(np.intp), axis=0)[0],
        }
        if pictures is not None:
            row = [rasters[name] * somewhere[..., None] for name in ("plain", "truth")]
            picture = np.concatenate([ours, *row], axis=1).astype(np.uint8)
            cv2.imwrite(str(pictures.with_name(f"{pictures.name}-{chart}.png")), picture[..., ::-1])
        parts.append({name: raster[somewhere] for name, raster in rasters.items()})
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    hidden, taken, example = whole["hidden"], whole["taken"], whole["example"]
    regions = {
        "all": np.ones_like(hidden),
        "seen": ~hidden,
        "hidden": hidden,
        "taken": taken,
        "example": example,
        "rest": ~(taken | example),
    }
    return {
        **{name: _compared(whole, region) for name, region in regions.items()},
        "through of 10,000": {
            "ours": round(1e4 * float(whole["ours through"][taken].mean()), 1) if taken.any() else None,
            "plain": round(1e4 * float(whole["plain through"].mean()), 1),
        },
        "exposure": {
            "before": round(max(gains) / min(gains), 3),
            "after": round(float(left.max() / left.min()), 3),
        },
        "seconds": {name: round(statistics.mean(values), 3) for name, values in seconds.items()},
    }


def _compared(whole: dict[str, np.ndarray], region: np.ndarray) -> dict[str, Any]:
    """The share of a region, and PSNR over it."""
    found: dict[str, Any] = {"share": round(float(region.mean()), 3)}
    if region.any():
        truth = whole["truth"][region].astype(np.float64)
        for name in ("ours", "plain", "material"):
            found[name] = psnr(whole[name][region].astype(np.float64), truth)
    return found


def shown_reader(scene: Scene, shown: Mapping[int, FusedCameraView]) -> ChartReader:
    """What cameras show of charts, as a run reads it."""

    def read(chart: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        if chart not in shown:
            shape = (rows.stop - rows.start, columns.stop - columns.start)
            return np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
        found = shown[chart]
        rank = np.where(found.is_visible, Provenance.PHOTO, Provenance.UNSEEN).astype(np.uint8)
        return found.rgb[rows, columns], rank[rows, columns]

    return read


def ground_points(scene: Scene, chart: int, size: tuple[int, int]) -> np.ndarray:
    step = 1 / float(scene.placement.texels_per_metre[chart])
    x, y = np.meshgrid((np.arange(size[1]) + 0.5) * step, (np.arange(size[0]) + 0.5) * step)
    return scene.charts.points(chart, x, y)


def psnr(image: np.ndarray, truth: np.ndarray) -> float:
    """In dB, a factor per channel aside."""
    factor = (image * truth).sum(axis=0) / np.maximum((image * image).sum(axis=0), 1e-9)
    return round(float(10 * np.log10(255**2 / np.maximum(((factor * image - truth) ** 2).mean(), 1e-9))), 2)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Ground from posed panoramas of a street that is known.")
    parser.add_argument("--seed", type=int, default=3, help="of the street, its paint and its cameras")
    parser.add_argument("--buildings", type=int, default=8, help="houses on the street, an even number")
    parser.add_argument("--cameras", type=int, default=5)
    parser.add_argument("--width", type=int, default=4096, help="pixels of a panorama")
    parser.add_argument(
        "--pictures", type=Path, help="folder for pictures of the ground: ours, plain projection, the truth"
    )
    options = parser.parse_args()
    found = measure(**vars(options))
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
