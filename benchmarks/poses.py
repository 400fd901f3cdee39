"""Poses of panoramas, refined: `python -m benchmarks.poses [--data DIR]` prints one JSON object.

painted: streets whose textures are known, six cameras each, poses off by 0.3 m and 1 degree, and by up to 2 m in height where
they are raised: errors of the poses. amsterdam: with --data, real panoramas of both example blocks, which are as a run has
them: the tilts of edges on rectified walls, degrees. Poses are as given, refined alone, refined together after that, as a run
does, and true. left_out, of both: each panorama is left out in turn, and what it shows of each wall is foretold by the others,
fused as a run does: PSNR in dB, a factor a channel aside, and SSIM over the texels that both show, means over walls and
panoramas. registered: the same where what is foretold is first shifted on the wall, as a whole, to where it fits best; shift_m:
by how many metres, median. What a shift brings is the poses' fault, or that of the wall's place in the model.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.imagery import (
    LEAST_SEEN,
    VIEWS,
    edge_tilt,
    pose_errors,
    psnr,
    ssim,
    street_with_cameras,
)
from benchmarks.painter.street_truth import SyntheticStreet, cutout_mask
from catalogs.block.reader import read_block
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.joint_refinement import PriorPose, refine_jointly
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.rectify.fusion import ChartView, FusedView, fuse_views
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama
from tasks.stages.ingest.planning import make_plan
from tasks.stages.shared.images import read_panorama

# What is foretold is shifted by so many metres at most.
SHIFT_M = 2.5
# How far stated heights are off at most, where they are.
RAISED_M = 2.0
CAMERAS, BUILDINGS, WIDTH = 6, 8, 4096


def left_out(
    scene: Scene,
    walls: Sequence[int],
    images: Sequence[np.ndarray],
    poses: Sequence[Pose],
    view: Callable[[int, int], ChartView],
    texels_per_metre: float,
) -> dict[str, Any]:
    """Each panorama's views of walls, foretold by the others'; `view` makes that of a wall's chart by a panorama's number."""
    told: dict[str, list[float]] = {"psnr": [], "ssim": [], "registered": [], "shift_m": []}
    for chart in walls:
        shown = find_sightings(scene, chart, poses, [image.shape[:2] for image in images])
        views = {s.panorama: view(chart, s.panorama) for s in shown if s.seen_share >= LEAST_SEEN}
        for number, seen in views.items():
            others = [other for panorama, other in views.items() if panorama != number][:VIEWS]
            if others:
                _compare(told, seen, fuse_views(others), texels_per_metre)
    means = {name: round(statistics.mean(values), 3) for name, values in told.items() if values and name != "shift_m"}
    if told["shift_m"]:
        means["shift_m"] = round(statistics.median(told["shift_m"]), 3)
    return {**means, "views": len(told["psnr"])}


def _compare(told: dict[str, list[float]], seen: ChartView, foretold: FusedView, texels_per_metre: float) -> None:
    clear = seen.seen if seen.occluded is None else seen.seen & ~seen.occluded
    shown = replace(seen, seen=clear)
    other = replace(foretold, seen=foretold.seen & ~foretold.occluded)
    likeness, both = ssim(shown, other), shown.seen & other.seen
    if likeness is None or both.mean() < 0.05:
        return
    told["psnr"].append(psnr(other.rgb, shown.rgb, both))
    told["ssim"].append(likeness)
    dx, dy = _shift(shown, other, round(SHIFT_M * texels_per_metre))
    moved = np.array([[1, 0, dx], [0, 1, dy]], np.float64)
    size = (both.shape[1], both.shape[0])
    there = replace(
        other,
        rgb=np.asarray(cv2.warpAffine(other.rgb, moved, size), np.uint8),
        seen=cv2.warpAffine(other.seen.astype(np.uint8), moved, size, flags=cv2.INTER_NEAREST) > 0,
    )
    best = ssim(shown, there)
    told["registered"].append(likeness if best is None else max(best, likeness))
    told["shift_m"].append(float(np.hypot(dx, dy)) / texels_per_metre)


def _shift(seen: ChartView, foretold: FusedView, reach: int) -> tuple[int, int]:
    """Texels right and down by which the middle of what is foretold lies best on what is seen; none on a wall so small."""
    height, width = seen.seen.shape
    if min(height, width) <= 4 * reach:
        return 0, 0
    grey = [cv2.cvtColor(one.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32) for one in (seen, foretold)]
    soft = [cv2.GaussianBlur(one, (0, 0), 2) for one in grey]
    slope = [np.hypot(cv2.Sobel(one, cv2.CV_32F, 1, 0), cv2.Sobel(one, cv2.CV_32F, 0, 1)) for one in soft]
    scores = cv2.matchTemplate(slope[0], slope[1][reach:-reach, reach:-reach], cv2.TM_CCOEFF_NORMED)
    row, column = np.unravel_index(int(scores.argmax()), scores.shape)
    return int(column) - reach, int(row) - reach


def painted(streets: int) -> dict[str, Any]:
    """Streets with truth, six cameras each."""
    poses: dict[str, list[Pose]] = {}
    raised: dict[str, list[Pose]] = {}
    told: dict[str, list[dict[str, Any]]] = {}
    for seed in range(3, 3 + streets):
        street, true, given, images = street_with_cameras(seed, BUILDINGS, CAMERAS, WIDTH)
        for name, taken in {**refined_poses(street.scene, images, given), "true": true}.items():
            poses.setdefault(name, []).extend(taken)
            told.setdefault(name, []).append(_left_out_of(street, images, true, taken))
        off = np.random.default_rng(seed).uniform(-RAISED_M, RAISED_M, len(given))
        high = [replace(pose, z=float(pose.z or 0.0) + up) for pose, up in zip(given, off.tolist(), strict=True)]
        for name, taken in refined_poses(street.scene, images, high).items():
            raised.setdefault(name, []).extend(taken)
    means = {
        name: {key: round(statistics.mean(one[key] for one in each), 3) for key in each[0]}
        for name, each in told.items()
    }
    errors = {name: pose_errors(found, poses["true"]) for name, found in poses.items() if name != "true"}
    return {
        "pose_errors": errors,
        "pose_errors_raised": {name: pose_errors(found, poses["true"]) for name, found in raised.items()},
        "left_out": means,
        "cameras": len(poses["true"]),
    }


def refined_poses(scene: Scene, images: Sequence[np.ndarray], given: Sequence[Pose]) -> dict[str, Sequence[Pose]]:
    """The poses given, those refined alone, and those refined together after that, as a run has them in the end."""
    alone = [refine_pose(scene, image, pose) for image, pose in zip(images, given, strict=True)]
    start = [PriorPose(one.pose, one.covariance) for one in alone]
    surfaces = np.flatnonzero(np.isin(scene.charts.kind, (ChartKind.WALL, ChartKind.GROUND))).tolist()
    found = refine_jointly(scene, surfaces, images, start)
    return {"given": given, "refined": [one.pose for one in alone], "together": [one.pose for one in found]}


def _left_out_of(
    street: SyntheticStreet, images: Sequence[np.ndarray], true: Sequence[Pose], taken: Sequence[Pose]
) -> dict[str, Any]:
    facade = {chart: number for number, chart in enumerate(street.charts)}

    def view(chart: int, n: int) -> ChartView:
        size = street.facades[facade[chart]].image.shape[:2]
        found = rectify_chart_from_panorama(street.scene, chart, images[n], taken[n], size)
        return replace(found, occluded=cutout_mask(street, facade[chart], true[n], size, assumed_pose=taken[n]))

    return left_out(street.scene, street.charts, images, taken, view, street.scene.spec.texels_per_metre)


def amsterdam(data: Path) -> dict[str, Any]:
    """Real panoramas of the example blocks, each with the block as a run has it; two show two walls both."""
    tilts: dict[str, list[float]] = {}
    told: dict[str, dict[str, Any]] = {}
    placed, cameras = 0, 0
    os.environ["STREETLOOM_DATA"] = str(data.resolve())  # which the packaged block files name
    for name in ("amsterdam-dam", "amsterdam-ij"):
        block = read_block(EXAMPLE_BLOCKS_FOLDER / f"{name}.yaml")
        plan = make_plan(block)
        scene, facades = plan.scene, plan.facades.chart.tolist()
        images = [read_panorama(panorama.path) for panorama in block.panoramas]
        sizes = [image.shape[:2] for image in images]
        cameras += len(images)
        for pose_of, taken in refined_poses(scene, images, plan.poses).items():

            def view(
                chart: int,
                n: int,
                *,
                scene: Scene = scene,
                images: Sequence[np.ndarray] = images,
                taken: Sequence[Pose] = taken,
            ) -> ChartView:
                size = scene.placement.shape(chart)
                return rectify_chart_from_panorama(scene, chart, images[n], taken[n], size)

            for chart in facades:
                shown = [s for s in find_sightings(scene, chart, plan.poses, sizes) if s.seen_share >= LEAST_SEEN][
                    :VIEWS
                ]
                edges = [edge_tilt(view(chart, s.panorama)) for s in shown]
                tilts.setdefault(pose_of, []).extend(abs(v) for e in edges for v in e.values() if v is not None)
            if len(images) > 1:  # of the Dam one panorama has a pose
                told[pose_of] = left_out(scene, facades, images, taken, view, scene.spec.texels_per_metre)
            if pose_of == "refined":
                placed += sum(one != given for one, given in zip(taken, plan.poses, strict=True))
    summary = {
        pose_of: {
            "median": round(float(np.median(edges)), 3),
            "largest": round(max(edges), 3),
            "within_half_a_degree": round(float(np.mean(np.array(edges) <= 0.5)), 3),
            "edges": len(edges),
        }
        for pose_of, edges in tilts.items()
    }
    return {"tilts": summary, "left_out": told, "cameras": cameras, "refined_alone": placed}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "--data", type=Path, help="folder with city/amsterdam and facades/ecp, as the example blocks name them"
    )
    parser.add_argument("--streets", type=int, default=3)
    options = parser.parse_args()
    result: dict[str, Any] = {"benchmark": "poses"}
    if options.streets:
        result["painted"] = painted(options.streets)
    if options.data:
        result["amsterdam"] = amsterdam(options.data)
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
