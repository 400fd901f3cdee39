"""Ground from posed panoramas: `python -m benchmarks.cameras` prints one JSON object; it needs no data.

A synthetic street whose ground is painted, with cut-outs of cars, trees and lamps before the houses, is seen by panoramas of
different exposure whose poses are off by 0.3 m and 1 degree and then refined, as a run does it. Over the texels of ground that
some camera shows, PSNR in dB with a factor per channel aside: of what `facade_core.cameras` takes, with the material in the
texels that it leaves (`ours`); of each texel from the camera that shows it best, as it is (`plain`); of the material alone, as
without cameras (`material`). taken: PSNR and share of the texels that are taken. through: the share of those that show a
cut-out instead of the ground, `plain` likewise. exposure: what is left of the cameras' differences, as a ratio (1 is none).
seconds: of each step, a camera.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from facade_core.cameras import Camera, factors, in_the_way, look_down, photographed, usual_of
from facade_core.geometry.charts import GROUND
from facade_core.geometry.packing import pack
from facade_core.rectify import refine_pose
from facade_core.rectify.camera import GROUND_REACH_M
from facade_core.rectify.panorama import rectify_view
from facade_core.street.field import Materials
from facade_core.street.scene import Scene
from facade_core.synth.street_truth import SyntheticStreet, hidden_points, painted_ground, panorama, synthetic_street
from facade_core.types import Pose

POSE_NOISE_M, POSE_NOISE_DEG = 0.3, 1.0
# Of the ground's texels; those of the walls stay.
DENSITY = 16.0


def measure(*, seed: int = 3, buildings: int = 8, cameras: int = 5, width: int = 4096) -> dict[str, Any]:
    """A street of so many houses and cameras."""
    street = synthetic_street(buildings, seed=seed)
    paint = painted_ground(street)
    rng = np.random.default_rng(seed)
    true, given, gains, images = [], [], [], []
    for number in range(cameras):
        x, y = street.place((number + 0.5) / cameras * street.length, (-1) ** number * 1.5)
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
        images.append(panorama(street, pose, width, gain=gains[-1], seed=number, ground=paint))
    scene = _finer(street.scene)
    found: dict[str, Any] = {"benchmark": "cameras", "cameras": cameras, "texels_per_metre": DENSITY}
    for name, poses in (("given", given), ("refined", None), ("true", true)):
        found[name] = _recovered(scene, street, images, true, poses or _refined(street.scene, images, given), gains)
    return found


def _refined(scene: Scene, images: Sequence[np.ndarray], given: Sequence[Pose]) -> list[Pose]:
    return [refine_pose(scene, image, pose).pose for image, pose in zip(images, given, strict=True)]


def _finer(scene: Scene) -> Scene:
    """The scene with its ground at DENSITY."""
    density = np.where(scene.charts.kind == GROUND, DENSITY, scene.placement.texels_per_metre)
    placement = pack(scene.charts.size, density, scene.charts.building, page=2048, chunk=128, gutter=2)
    return replace(scene, placement=placement)


def _recovered(
    scene: Scene,
    street: SyntheticStreet,
    images: Sequence[np.ndarray],
    true: Sequence[Pose],
    poses: Sequence[Pose],
    gains: Sequence[float],
) -> dict[str, Any]:
    paint = painted_ground(street)
    seconds: dict[str, list[float]] = {"look": [], "mask": [], "ground": []}
    cameras, squares = [], []
    for image, pose in zip(images, poses, strict=True):
        start = time.perf_counter()
        squares.append(look_down(scene, image, pose).squares)
        looked = time.perf_counter()
        hidden = in_the_way(image, pose)
        seconds["look"].append(looked - start)
        seconds["mask"].append(time.perf_counter() - looked)
        cameras.append(Camera(image, pose, hidden, np.ones(3), usual_of(squares[-1])))
    factor = factors(squares)
    cameras = [replace(camera, factor=own) for camera, own in zip(cameras, factor, strict=True)]
    left = np.array(gains) * factor.mean(axis=1)
    materials = Materials(scene, (), seed=1)
    texels: dict[str, list[np.ndarray]] = {name: [] for name in ("truth", "ours", "plain", "material", "taken")}
    through: dict[str, list[np.ndarray]] = {"ours": [], "plain": []}
    for chart in np.flatnonzero(scene.charts.kind == GROUND).tolist():
        size = (int(scene.placement.height[chart]), int(scene.placement.width[chart]))
        views = [rectify_view(scene, chart, c.image, c.pose, size) for c in cameras]
        points = _points(scene, chart, size)
        away = [np.hypot(points[..., 0] - c.pose.x, points[..., 1] - c.pose.y) for c in cameras]
        seen = np.stack([v.seen & (a <= GROUND_REACH_M) for v, a in zip(views, away, strict=True)])
        if not seen.any():
            continue
        start = time.perf_counter()
        shown = photographed(scene, chart, cameras)
        seconds["ground"].append((time.perf_counter() - start) / max(1, int(seen.any(axis=(1, 2)).sum())))
        best = np.where(seen, np.stack([v.quality for v in views]), -1).argmax(axis=0)
        somewhere = seen.any(axis=0)
        plain = np.stack([v.rgb for v in views])[best, *np.indices(size)]
        material = materials.raster(chart).reshape(*size, 3)
        taken = np.zeros(size, bool) if shown is None else shown.shown
        ours = material if shown is None else np.where(taken[..., None], shown.rgb, material)
        covered = np.stack([hidden_points(street, points, a, supposed=b) for a, b in zip(true, poses, strict=True)])
        truth = paint(points[somewhere][:, :2])
        for name, values in (("truth", truth), ("ours", ours[somewhere]), ("plain", plain[somewhere])):
            texels[name].append(values.astype(np.float64))
        texels["material"].append(material[somewhere].astype(np.float64))
        texels["taken"].append(taken[somewhere])
        through["plain"].append(np.take_along_axis(covered, best[None], axis=0)[0][somewhere])
        if shown is not None:
            camera = np.maximum(shown.camera, 0)[None].astype(np.intp)
            through["ours"].append(np.take_along_axis(covered, camera, axis=0)[0][taken])
    whole = {name: np.concatenate(parts) for name, parts in texels.items()}
    taken = whole.pop("taken")
    return {
        **{name: _psnr(whole[name], whole["truth"]) for name in ("ours", "plain", "material")},
        "taken": {
            "share": round(float(taken.mean()), 3),
            **{name: _psnr(whole[name][taken], whole["truth"][taken]) for name in ("ours", "plain", "material")},
        },
        "through": {n: round(float(np.concatenate(p).mean()), 5) if p else None for n, p in through.items()},
        "exposure": {
            "before": round(max(gains) / min(gains), 3),
            "after": round(float(left.max() / left.min()), 3),
        },
        "seconds": {name: round(statistics.mean(values), 3) for name, values in seconds.items()},
    }


def _points(scene: Scene, chart: int, size: tuple[int, int]) -> np.ndarray:
    step = 1 / float(scene.placement.texels_per_metre[chart])
    x, y = np.meshgrid((np.arange(size[1]) + 0.5) * step, (np.arange(size[0]) + 0.5) * step)
    return scene.charts.points(chart, x, y)


def _psnr(image: np.ndarray, truth: np.ndarray) -> float:
    """In dB, a factor per channel aside."""
    factor = (image * truth).sum(axis=0) / np.maximum((image * image).sum(axis=0), 1e-9)
    return round(float(10 * np.log10(255**2 / np.maximum(((factor * image - truth) ** 2).mean(), 1e-9))), 2)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Ground from posed panoramas of a street that is known.")
    parser.add_argument("--buildings", type=int, default=8, help="houses on the street, an even number")
    parser.add_argument("--cameras", type=int, default=5)
    parser.add_argument("--width", type=int, default=4096, help="pixels of a panorama")
    options = parser.parse_args()
    print(json.dumps(measure(buildings=options.buildings, cameras=options.cameras, width=options.width), indent=1))


if __name__ == "__main__":
    main()
