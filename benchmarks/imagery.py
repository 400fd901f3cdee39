"""Posed panoramas: `python -m benchmarks.imagery --data DIR` prints one JSON object.

amsterdam: real panoramas against known walls. Per wall and panorama the tilt of the dominant level and upright edges of the
rectified wall, in degrees, with the given pose and the refined one; walls seen by two panoramas are compared with each other
and with the fused raster (SSIM on texels that both show).
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Pose
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.rectify.fusion import ChartView, FusedView, fuse_views
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama

# Views of a wall that are compared or fused, and the least share of it that each shows.
VIEWS, LEAST_SEEN = 3, 0.25
# Edges within this many degrees of level or upright are taken to be so.
EDGE_DEG = 5.0
POSE_NOISE_M, POSE_NOISE_DEG = 0.3, 1.0


def scene_of_walls(corners: np.ndarray, texels_per_metre: float) -> Scene:
    """A scene of upright rectangles, a chart each: corners (n, 4, 3) from the upper left clockwise, seen from outside."""
    n = len(corners)
    each = np.arange(n, dtype=np.int32)
    across, down = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    size = np.stack([np.linalg.norm(across, axis=1), np.linalg.norm(down, axis=1)], axis=1)
    frame = (corners[:, 0].copy(), across / size[:, :1], down / size[:, 1:])
    charts = Charts(np.full(n, ChartKind.WALL, np.uint8), each, each, *frame, size)
    triangles = (np.array([[0, 3, 2], [0, 2, 1]]) + 4 * each[:, None, None]).reshape(-1, 3).astype(np.int32)
    mesh = Mesh(corners.reshape(-1, 3), triangles, np.repeat(each, 2), np.repeat(each, 4))
    placement = pack_charts(charts.size, texels_per_metre, each, page=2048, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, texels_per_metre))


def edge_tilt(view: ChartView) -> dict[str, float | None]:
    """Median tilt in degrees, by length, of the near-level and near-upright edges of a rectified wall; None without."""
    import cv2

    grey = cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY)
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    lines = np.zeros((0, 4)) if found is None else found.reshape(-1, 4).astype(np.float64)
    inner = cv2.erode(view.seen.astype(np.uint8), np.ones((9, 9), np.uint8), borderValue=0)
    middle = np.floor((lines[:, :2] + lines[:, 2:]) / 2).astype(int)
    lines = lines[inner[middle[:, 1], middle[:, 0]] > 0]
    across, down = lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]
    length = np.hypot(across, down)
    tilts: dict[str, float | None] = {}
    for name, angle in (("level", np.arctan2(down, across)), ("upright", np.arctan2(-across, down))):
        degrees = (np.degrees(angle) + 90) % 180 - 90
        near = (np.abs(degrees) < EDGE_DEG) & (length >= 16)
        tilts[name] = round(_weighted_median(degrees[near], length[near]), 3) if near.sum() >= 8 else None
    return tilts


def posed_walls(
    folder: Path, texels_per_metre: float = 20.0
) -> tuple[dict[str, Pose], list[np.ndarray], list[str], Scene]:
    """Amsterdam's panoramas with a position, by name, and their pictures; the names of the walls that are known, and a scene of
    them, a chart each."""
    stated = json.loads((folder / "poses_and_walls.json").read_text(encoding="utf-8"))
    walls = {f"{b}/{w}": corners for b, parts in stated["walls"].items() for w, corners in parts.items()}
    given = {
        name: Pose(float(x), float(y), float(z), heading=0.0) for name, (x, y, z) in stated["camera_positions"].items()
    }
    images = [read(folder / "panoramas" / f"{name}.jpg") for name in given]
    return given, images, list(walls), scene_of_walls(np.array(list(walls.values()), np.float64), texels_per_metre)


def amsterdam(folder: Path, *, texels_per_metre: float = 20.0) -> dict[str, Any]:
    """Every panorama with a position against every wall that it shows."""
    stated, images, names, scene = posed_walls(folder, texels_per_metre)
    given, refined, poses = list(stated.values()), [], {}
    for name, pose, image in zip(stated, given, images, strict=True):
        result = refine_pose(scene, image, pose)
        refined.append(result.pose)
        facts = {key: getattr(result, key) for key in _FACTS}
        poses[name] = {k: round(v, 3) if isinstance(v, float) else v for k, v in facts.items()}
    measured: dict[str, Any] = {"poses": poses, "walls": {}, "agreement": {}}
    tilts: dict[str, list[float]] = {"before": [], "after": []}
    for chart, wall in enumerate(names):
        shown = find_sightings(scene, chart, given, [image.shape[:2] for image in images])
        shown = [s for s in shown if s.seen_share >= LEAST_SEEN][:VIEWS]
        if not shown:
            continue
        size = scene.placement.shape(chart)
        entry, views = {}, {}
        for when, taken in (("before", given), ("after", refined)):
            views[when] = [
                rectify_chart_from_panorama(scene, chart, images[s.panorama], taken[s.panorama], size) for s in shown
            ]
            entry[when] = [edge_tilt(view) for view in views[when]]
            tilts[when] += [abs(v) for e in entry[when] for v in e.values() if v is not None]
        measured["walls"][wall] = entry
        if len(shown) > 1:
            fused = {when: fuse_views(views[when]) for when in views}
            measured["agreement"][wall] = {
                when: {
                    "between": ssim(views[when][0], views[when][1]),
                    "with_fused": [ssim(view, fused[when]) for view in views[when][:2]],
                }
                for when in views
            }
    for when, values in tilts.items():
        measured[f"tilt_{when}"] = {
            "median": round(float(np.median(values)), 3),
            "largest": round(max(values), 3),
            "within_half_a_degree": round(float(np.mean(np.array(values) <= 0.5)), 3),
            "edges": len(values),
        }
    return measured


def street_with_cameras(
    seed: int, buildings: int, panoramas: int, width: int
) -> tuple[SyntheticStreet, list[Pose], list[Pose], list[np.ndarray]]:
    """A painted street, the true poses of panoramas there, poses that are off, and the panoramas."""
    street = synthetic_street(buildings, seed=seed)
    rng = np.random.default_rng(seed)
    true, given, images = [], [], []
    for number in range(panoramas):
        x, y = street.world_point((number + 0.5) / panoramas * street.length, (-1) ** number * 1.5)
        pose = Pose(float(x), float(y), 2.5, float(rng.uniform(0, 360)), *rng.normal(0, 0.5, 2).tolist())
        off = rng.normal(0, 1, 3)
        true.append(pose)
        sideways = rng.uniform(0, 2 * np.pi)
        noise: dict[str, Any] = {
            "x": pose.x + POSE_NOISE_M * float(np.cos(sideways)),
            "y": pose.y + POSE_NOISE_M * float(np.sin(sideways)),
            "heading": pose.heading + POSE_NOISE_DEG * float(np.sign(off[0])),
            "pitch": pose.pitch + 0.3 * float(off[1]),
            "roll": pose.roll + 0.3 * float(off[2]),
        }
        given.append(replace(pose, **noise))
        images.append(render_street_panorama(street, pose, width, gain=float(rng.uniform(0.8, 1.0)), seed=number))
    return street, true, given, images


_FACTS = (
    "given_degrees",
    "residual_degrees",
    "given_fit",
    "fit",
    "moved_m",
    "turned_deg",
    "lines",
    "outlines",
    "reasons",
)


def psnr(image: np.ndarray, truth: np.ndarray, shown: np.ndarray) -> float:
    """PSNR in dB over the shown texels, a factor per channel aside: the exposure of a photo is no error."""
    a, b = image[shown].astype(np.float64), truth[shown].astype(np.float64)
    factor = (a * b).sum(axis=0) / np.maximum((a * a).sum(axis=0), 1e-9)
    return float(10 * np.log10(255**2 / np.maximum(((factor * a - b) ** 2).mean(), 1e-9)))


def pose_errors(poses: Sequence[Pose], true: Sequence[Pose]) -> dict[str, float]:
    """Means, medians and largest over poses of the distance, metres, and the turn, degrees, from the true ones."""
    from facade_core.imagery.panorama_camera import camera_from_world, camera_position

    metres = [float(np.linalg.norm(camera_position(a) - camera_position(b))) for a, b in zip(poses, true, strict=True)]
    turns = [camera_from_world(a) @ camera_from_world(b).T for a, b in zip(poses, true, strict=True)]
    degrees = [float(np.degrees(np.arccos(np.clip((np.trace(t) - 1) / 2, -1, 1)))) for t in turns]
    told = {}
    for name, values in (("metres", metres), ("degrees", degrees)):
        told[name] = round(statistics.mean(values), 3)
        told[f"{name}_median"] = round(statistics.median(values), 3)
        told[f"{name}_largest"] = round(max(values), 3)
    return told


def ssim(one: ChartView | FusedView, other: ChartView | FusedView) -> float | None:
    """Mean SSIM of the grey pictures, 10 pixels per metre, over what both show; None where that is little."""
    import cv2
    from skimage.metrics import structural_similarity

    both = cv2.erode((one.seen & other.seen).astype(np.uint8), np.ones((9, 9), np.uint8), borderValue=0)
    small = (both.shape[1] // 2, both.shape[0] // 2)
    shared = cv2.resize(both, small, interpolation=cv2.INTER_NEAREST) > 0
    greys = [
        cv2.resize(cv2.cvtColor(v.rgb, cv2.COLOR_RGB2GRAY), small, interpolation=cv2.INTER_AREA) for v in (one, other)
    ]
    if shared.mean() < 0.05 or min(small) < 7:
        return None
    values = structural_similarity(*greys, full=True)[1]
    return round(float(values[shared].mean()), 4)


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(share, share[-1] / 2)])


def read(path: Path) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Posed panoramas against known walls.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with city/amsterdam",
    )
    parser.add_argument("--parts", nargs="*", choices=["amsterdam"], help="the one part there is")
    options = parser.parse_args(arguments)
    print(json.dumps({"benchmark": "imagery", "amsterdam": amsterdam(options.data / "city" / "amsterdam")}))


if __name__ == "__main__":
    main()
