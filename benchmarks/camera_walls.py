"""Side walls and roofs from posed panoramas: `python -m benchmarks.camera_walls` prints one JSON object; it needs no data.

As `benchmarks.cameras`, of a street with roofs, a gap and houses of unequal heights, whose walls that are no fronts and roofs
are painted. Over the texels of these that some camera shows, by walls and roofs: PSNR in dB with a factor per channel aside,
and SSIM of brightness, of what a run finishes (`ours`), of each texel from the camera that shows it best (`plain`), of the
material alone. Apart: `seen`, what a camera shows with nothing before it; `hidden`, behind cut-outs for every camera; `taken`
from cameras; `example`, continued. through: the share of texels taken that show a cut-out, and beside, that show another
surface or the sky, for a pose that is off; `plain` likewise. null: no camera shows a wall, or a roof. seconds: to mask, a
camera; to take a chart, a camera; to finish a chart.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely

from benchmarks.cameras import photographed_street, psnr, refined, shown_reader
from benchmarks.painter.street_paint import ground_pattern_painter, side_pattern_painter
from benchmarks.painter.street_truth import SyntheticStreet, is_behind_cutout, synthetic_street
from facade_core.core.provenance import Provenance
from facade_core.core.types import Pose, Street
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.overhead_view import texel_points
from facade_core.geometry.scene import Scene
from facade_core.geometry.walls import main_surface_mask
from facade_core.imagery.cameras.camera_view import FusedCameraView, PanoramaCamera
from facade_core.imagery.cameras.exposure import estimate_common_exposure, sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders, mask_model_edges
from facade_core.imagery.cameras.walls import chart_coverage_mask, fuse_wall_view
from facade_core.imagery.panorama_camera import WALL_REACH_M, camera_from_world, camera_position
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart

# Of the charts that are measured; the fronts stay as they are painted.
DENSITY = 12.0
# What is told apart, and whether it is a roof.
KINDS = {"walls": False, "roofs": True}


def measure(
    *, seed: int = 3, buildings: int = 8, cameras: int = 5, width: int = 2048, pictures: Path | None = None
) -> dict[str, Any]:
    """A street of so many houses and cameras; pictures: a folder for those of its walls and roofs."""
    street = synthetic_street(buildings, seed=seed, with_roofs=True)
    paint = side_pattern_painter(street)
    true, given, gains, images = photographed_street(
        street, cameras, width, seed, ground=ground_pattern_painter(street), sides=paint
    )
    scene = _coarser(street)
    start = time.perf_counter()
    hidden = [mask_building_occluders(image, pose) for image, pose in zip(images, given, strict=True)]
    seconds = (time.perf_counter() - start) / len(images)
    found: dict[str, Any] = {"benchmark": "camera_walls", "cameras": cameras, "texels_per_metre": DENSITY}
    for name, poses in (("given", given), ("refined", refined(street.scene, images, given)), ("true", true)):
        found[name] = _recovered(scene, street, images, hidden, true, poses, pictures and pictures / name)
    return found | {"exposures": round(max(gains) / min(gains), 3), "seconds to mask": round(seconds, 3)}


def _coarser(street: SyntheticStreet) -> Scene:
    scene = street.scene
    density = np.full(len(scene.charts), DENSITY)
    density[list(street.charts)] = scene.spec.texels_per_metre
    placement = pack_charts(scene.charts.size, density, scene.charts.building, page=2048, chunk=128, gutter=2)
    return replace(scene, placement=placement)


def _recovered(
    scene: Scene,
    street: SyntheticStreet,
    images: Sequence[np.ndarray],
    hidden: Sequence[np.ndarray],
    true: Sequence[Pose],
    poses: Sequence[Pose],
    pictures: Path | None,
) -> dict[str, Any]:
    paint = side_pattern_painter(street)
    squares = [sample_ground_colours(scene, image, pose).squares for image, pose in zip(images, poses, strict=True)]
    cameras = [
        PanoramaCamera(
            image, pose, mask | mask_model_edges(scene, pose, mask.shape), factor, typical_ground_colour(own)
        )
        for image, pose, mask, factor, own in zip(
            images, poses, hidden, estimate_common_exposure(squares).factors, squares, strict=True
        )
    ]
    line = Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))
    materials = MaterialField(scene, (line,), seed=1)
    seconds: dict[str, list[float]] = {"take": [], "finish": []}
    charts = [c for c in np.flatnonzero(main_surface_mask(scene.charts)).tolist() if c not in street.charts]
    shown: dict[int, FusedCameraView] = {}
    for chart in charts:
        start = time.perf_counter()
        found = fuse_wall_view(scene, chart, cameras)
        seconds["take"].append((time.perf_counter() - start) / len(cameras))
        if found is not None:
            shown[chart] = found
    known = KnownTexture(shown_reader(scene, shown), shown, shown)
    without = KnownTexture(shown_reader(scene, {}), ())
    parts = []
    for chart in charts:
        size = scene.placement.shape(chart)
        points = texel_points(scene, chart, np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
        views = [rectify_chart_from_panorama(scene, chart, c.image, c.pose, size) for c in cameras]
        own = chart_coverage_mask(scene, chart)
        near = [np.linalg.norm(points - camera_position(c.pose), axis=2) <= WALL_REACH_M for c in cameras]
        seen = np.stack([v.seen & own & n for v, n in zip(views, near, strict=True)])
        somewhere = np.asarray(seen.any(axis=0))
        if not somewhere.any():
            continue
        start = time.perf_counter()
        ours, provenance = finish_chart(scene, materials, chart, known)
        seconds["finish"].append(time.perf_counter() - start)
        best = np.where(seen, np.stack([v.quality for v in views]), -1).argmax(axis=0)
        before, beside = (
            np.stack([test(street, chart, points, a, b) for a, b in zip(true, poses, strict=True)])
            for test in (_before, _beside)
        )
        camera = shown[chart].camera if chart in shown else np.full(size, -1, np.int8)
        x, y = np.meshgrid((np.arange(size[1]) + 0.5) / DENSITY, (np.arange(size[0]) + 0.5) / DENSITY)
        truth = paint(np.full(x.size, chart), x.ravel(), y.ravel()).reshape(*size, 3)
        rasters = {
            "truth": truth,
            "ours": ours,
            "plain": np.stack([v.rgb for v in views])[best, *np.indices(size)],
            "material": finish_chart(scene, materials, chart, without)[0],
            "somewhere": somewhere,
            "roof": np.full(size, scene.charts.kind[chart] == ChartKind.ROOF),
            "hidden": np.asarray(~(seen & ~before).any(axis=0)),
            "taken": camera >= 0,
            "example": provenance == Provenance.INPAINTED,
        }
        for name, wrong in (("through", before), ("beside", beside)):
            for whose, chosen in (("plain", best), ("ours", np.maximum(camera, 0))):
                rasters[f"{whose} {name}"] = np.take_along_axis(wrong, chosen[None].astype(np.intp), axis=0)[0]
        parts.append(rasters)
        if pictures is not None:
            row = [rasters[name] * own[..., None] for name in ("ours", "plain", "material", "truth")]
            picture = np.concatenate(row, axis=1).astype(np.uint8)
            pictures.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(pictures / f"{chart}.png"), picture[..., ::-1])
    told = {name: _told([part for part in parts if bool(part["roof"].flat[0]) == roof]) for name, roof in KINDS.items()}
    return {**told, "seconds": {name: round(statistics.mean(values), 3) for name, values in seconds.items() if values}}


def _before(street: SyntheticStreet, chart: int, points: np.ndarray, true: Pose, supposed: Pose) -> np.ndarray:
    """Where the raster of a chart shows a cut-out, (h, w) bool."""
    return is_behind_cutout(street, points, true, assumed_pose=supposed)


def _beside(street: SyntheticStreet, chart: int, points: np.ndarray, true: Pose, supposed: Pose) -> np.ndarray:
    """Where the raster of a chart shows another surface, or the sky, for the pose is not the true one: (h, w) bool."""
    rays = (points - camera_position(supposed)) @ camera_from_world(supposed).T @ camera_from_world(true)
    _, hit = street.scene.caster.cast(camera_position(true), rays)
    surfaces = np.append(street.scene.charts.surface, -1)
    return surfaces[np.where(hit < 0, -1, hit)] != street.scene.charts.surface[chart]


def _told(parts: Sequence[dict[str, np.ndarray]]) -> dict[str, Any] | None:
    """Of walls, or of roofs; None where no camera shows one, as the roof of a house that is high for its street."""
    if not parts:
        return None
    whole = {name: np.concatenate([part[name][part["somewhere"]] for part in parts]) for name in parts[0]}
    likeness = {}
    for name in ("ours", "plain", "material"):
        factor = (whole[name].astype(float) * whole["truth"]).sum(axis=0) / (whole[name].astype(float) ** 2).sum(axis=0)
        likeness[name] = np.concatenate([_ssim(part, name, factor)[part["somewhere"]] for part in parts])
    regions = {
        "all": np.ones_like(whole["taken"]),
        "seen": ~whole["hidden"],
        "hidden": whole["hidden"],
        "taken": whole["taken"],
        "example": whole["example"],
        "rest": ~(whole["taken"] | whole["example"]),
    }
    told: dict[str, Any] = {}
    for region, mask in regions.items():
        told[region] = {"share": round(float(mask.mean()), 3)}
        for name in likeness if mask.any() else ():
            signal = psnr(whole[name][mask].astype(float), whole["truth"][mask].astype(float))
            told[region][name] = [signal, round(float(likeness[name][mask].mean()), 3)]
    for wrong in ("through", "beside"):
        ours = round(1e4 * float(whole[f"ours {wrong}"][whole["taken"]].mean()), 1) if whole["taken"].any() else None
        told[f"{wrong} of 10,000"] = {"ours": ours, "plain": round(1e4 * float(whole[f"plain {wrong}"].mean()), 1)}
    return told


def _ssim(part: dict[str, np.ndarray], name: str, factor: np.ndarray) -> np.ndarray:
    """Likeness (h, w) of a raster and the truth, where both are known."""
    from skimage.metrics import structural_similarity

    known = part["somewhere"][..., None]
    truth = np.where(known, part["truth"], 0).mean(axis=2)
    own = np.where(known, part[name] * factor, 0).mean(axis=2)
    if min(own.shape) < 7:
        return np.ones(own.shape)
    return np.asarray(structural_similarity(truth, own, data_range=255, full=True)[1])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Side walls and roofs from posed panoramas of a street that is known.")
    parser.add_argument("--seed", type=int, default=3, help="of the street, its paint and its cameras")
    parser.add_argument("--buildings", type=int, default=8, help="houses on the street, an even number")
    parser.add_argument("--cameras", type=int, default=5)
    parser.add_argument("--width", type=int, default=2048, help="pixels of a panorama")
    parser.add_argument(
        "--pictures", type=Path, help="folder for pictures of charts: ours, plain projection, material, the truth"
    )
    options = parser.parse_args()
    found = measure(**vars(options))
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
