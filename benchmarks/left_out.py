"""A panorama left out and foretold: `python -m benchmarks.left_out --block FILE` prints one JSON object.

The block is run as a user runs it, with all its panoramas, then without each in turn, then without any: one store, so that a
run makes anew what the picture shows. What was published is seen from where the picture was taken (its pose is that of
the run with all), in views of 90 degrees, and compared with the picture where it shows the block with nothing before it, as the
parser tells: PSNR in dB, a factor a channel and panorama aside, SSIM of brightness, and GMSD, the deviation of the likeness of
gradients (Xue et al. 2014; 0 is the same). Means over views, of walls with a facade, other walls and roofs, and ground; `shown`
by another panorama, and `not`. ours: the run without it; without: the run without any; plain: each pixel from the nearest other
panorama that shows its place, else as `without`, poses as the run without it has them; posed: the same at the poses of the run
with all, which the picture helped to find. seconds: of each run. --views keeps the views.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from benchmarks.city.runs import run
from catalogs.block.reader import Block, read_block
from facade_core.core.types import Pose
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import average_samples, cast_view
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders
from facade_core.imagery.panorama_camera import camera_position, is_in_view, project_directions_to_picture
from facade_core.imagery.rectify.panorama import OCCLUSION_TOLERANCE_M
from tasks.publish.published_run import PublishedBlock, open_published_run
from tasks.stages.bundles.refined_poses import is_rejected_panorama, pose_from_record
from tasks.stages.shared.images import read_panorama

HEADINGS, FIELD_OF_VIEW, SIDE, SAMPLES = 6, 90.0, 480, 2
# What is farther is not compared, metres; nor a view that shows less than this share of a kind.
FARTHEST_M, LEAST = 100.0, 0.01
# What is compared: a run without the panorama; the nearest other panorama, at the pose of that run, and of the run with all; a
# run without any.
MADE = ("ours", "plain", "posed", "without")
# Of the constant that keeps GMSD's quotient finite, for brightness of 0 to 255.
_GMSD = 170.0


@dataclass(frozen=True)
class Taken:
    """A panorama: its picture, the pose that a run found, and where something stands before the block, (H, W) bool."""

    image: np.ndarray
    pose: Pose
    hidden: np.ndarray


@dataclass(frozen=True)
class Seen:
    """A view of a published block by SAMPLES rays along each side of a pixel: dense_rgb (h, w, 3) uint8; dense_chart (h, w),
    MISS for sky; dense_points (h, w, 3), world metres."""

    dense_rgb: np.ndarray
    dense_chart: np.ndarray
    dense_points: np.ndarray

    @property
    def rgb(self) -> np.ndarray:
        """Means over pixels."""
        return average_samples(self.dense_rgb, SAMPLES)

    @property
    def chart(self) -> np.ndarray:
        """Of the middle of each pixel."""
        return self.dense_chart[SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES]

    @property
    def points(self) -> np.ndarray:
        """Likewise."""
        return self.dense_points[SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES]


@dataclass(frozen=True)
class Compared:
    """A view beside the picture: real (h, w, 3) uint8, clear of what stands before (h, w) bool; made, by MADE, (h, w, 3) uint8
    each; regions, by name, (h, w) bool."""

    real: np.ndarray
    clear: np.ndarray
    made: dict[str, np.ndarray]
    regions: dict[str, np.ndarray]


def main() -> None:
    """Run, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--block", type=Path, required=True, help="block file with at least two posed panoramas")
    parser.add_argument("--out", type=Path, help="folder in which the runs are kept; none without")
    parser.add_argument("--views", type=Path, help="folder for pictures of what was compared")
    parser.add_argument("--data", type=Path, help="folder of real data, which example blocks name as STREETLOOM_DATA")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    if options.data:
        os.environ["STREETLOOM_DATA"] = str(options.data.resolve())
    with tempfile.TemporaryDirectory(prefix="left-out-") as folder:
        found = measure(options.block, options.out or Path(folder), options.workers, options.views)
    print(json.dumps(found, indent=1))


def measure(file: Path, out: Path, workers: int, pictures: Path | None) -> dict[str, Any]:
    """A block with all panoramas, without each, and without any."""
    block = read_block(file)
    names = [panorama.path.name for panorama in block.panoramas]
    if len(names) < 2:
        raise SystemExit(f"{file}: {len(names)} panoramas have a pose; two at least are needed to foretell one")
    seconds = {"all": _run(file, block, names, out, workers)}
    taken = _taken(block, out)
    views = {name: _cameras(one.pose) for name, one in taken.items()}
    ours: dict[str, list[Seen]] = {}
    known: dict[str, dict[str, Taken]] = {}
    for name in taken:
        others = [other for other in names if other != name]
        seconds[f"without {name}"] = _run(file, block, others, out, workers)
        with open_published_run(out / "run") as found:
            ours[name] = [_seen(found, camera) for camera in views[name]]
            known[name] = _placed(found, others, taken)
    seconds["without any"] = _run(file, block, [], out, workers)
    told: dict[str, list[dict[str, float]]] = {}
    with open_published_run(out / "run") as found:
        for name, one in taken.items():
            compared = [
                _compared(found, one, camera, ours[name][number], known[name], taken)
                for number, camera in enumerate(views[name])
            ]
            factors = {made: _factor(compared, made) for made in MADE}
            for number, view in enumerate(compared):
                for region, mask in view.regions.items():
                    if mask.mean() >= LEAST:
                        told.setdefault(region, []).append(_likeness(view, factors, mask))
                if pictures is not None:
                    pictures.mkdir(parents=True, exist_ok=True)
                    row = np.concatenate([view.real * view.clear[..., None], *view.made.values()], axis=1)
                    cv2.imwrite(str(pictures / f"{Path(name).stem}_{number}.png"), row[..., ::-1])
    means = {
        region: {key: round(statistics.mean(one[key] for one in each), 3) for key in each[0]} | {"views": len(each)}
        for region, each in sorted(told.items())
    }
    return {"benchmark": "left_out", "panoramas": len(taken), **means, "seconds": seconds}


def _run(file: Path, block: Block, names: Sequence[str], out: Path, workers: int) -> float:
    """Run the block with these of its panoramas; seconds."""
    folder = out / "panoramas-of-left-out"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    stated = yaml.safe_load(file.read_text(encoding="utf-8"))
    for panorama in block.panoramas:
        if panorama.path.name in names:
            shutil.copy2(panorama.path, folder)
    stated = _absolute(stated, file.parent.resolve())
    if names:
        stated["imagery"]["panoramas"]["path"] = str(folder.resolve())
    else:
        del stated["imagery"]["panoramas"]
    (folder / "block.yaml").write_text(yaml.safe_dump(stated), encoding="utf-8")
    return round(run(folder / "block.yaml", out / "run", workers).seconds, 1)


def _absolute(value: Any, folder: Path) -> Any:
    """What a block file states, with paths that are from its folder on made absolute."""
    if isinstance(value, dict):
        return {key: _absolute(one, folder) for key, one in value.items()}
    if isinstance(value, list):
        return [_absolute(one, folder) for one in value]
    if isinstance(value, str) and value and (folder / os.path.expandvars(value)).exists():
        return str(folder / os.path.expandvars(value))
    return value


def _taken(block: Block, out: Path) -> dict[str, Taken]:
    """The panoramas that the run could place."""
    found = {}
    with open_published_run(out / "run") as run:
        for panorama, pose, record in zip(block.panoramas, run.plan.poses, run.refined_poses, strict=True):
            if not is_rejected_panorama(record):
                image = read_panorama(panorama.path)
                at = pose_from_record(pose, record)
                found[panorama.path.name] = Taken(image, at, mask_building_occluders(image, at))
    return found


def _placed(found: PublishedBlock, names: Sequence[str], taken: dict[str, Taken]) -> dict[str, Taken]:
    """The panoramas of a run of some, at the poses that this run found."""
    poses = zip(names, found.plan.poses, found.refined_poses, strict=True)
    return {
        name: Taken(taken[name].image, pose_from_record(pose, record), taken[name].hidden)
        for name, pose, record in poses
        if name in taken and not is_rejected_panorama(record)
    }


def _cameras(pose: Pose) -> list[PerspectiveCamera]:
    """Views around a panorama."""
    turns = np.arange(HEADINGS) * 360 / HEADINGS
    return [
        PerspectiveCamera.from_heading(
            camera_position(pose), heading=turn, pitch=0.0, field_of_view=FIELD_OF_VIEW, size=(SIDE, SIDE)
        )
        for turn in turns.tolist()
    ]


def _seen(found: PublishedBlock, camera: PerspectiveCamera) -> Seen:
    """What a camera sees of what was published, without haze."""
    scene = found.plan.scene
    picture = cast_view(scene, camera, samples=SAMPLES)
    for chart in picture.visible_charts[
        np.argsort(scene.placement.page[picture.visible_charts], kind="stable")
    ].tolist():
        picture.paint({chart: found.textured_mesh.raster(chart)})
    chart = np.full(picture.rgb.shape[:2], MISS, np.int32)
    depth = np.full(chart.shape, np.inf)
    chart.reshape(-1)[picture.pixel], depth.reshape(-1)[picture.pixel] = picture.chart, picture.depth
    return Seen(picture.rgb, chart, camera.position + picture.camera.rays() * depth[..., None])


def _kinds(found: PublishedBlock, chart: np.ndarray) -> dict[str, np.ndarray]:
    """Which pixels show which kind of surface."""
    hit, kind = chart != MISS, found.plan.scene.charts.kind
    facade, ground = np.isin(chart, found.plan.facades.chart), hit & (kind[chart] == ChartKind.GROUND)
    return {"facades": hit & facade, "other walls and roofs": hit & ~facade & ~ground, "ground": ground}


def _sampled(one: Taken, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a panorama shows in directions (..., 3): colours (..., 3) uint8, and where it does, clear of what is before."""
    share = project_directions_to_picture(directions, one.pose)
    left, top, width, height = one.pose.view
    rows, columns = one.image.shape[:2]
    x = ((share[..., 0] - left) % 1.0 / width * columns - 0.5).astype(np.float32)
    y = ((share[..., 1] - top) / height * rows - 0.5).astype(np.float32)
    rgb = cv2.remap(one.image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    at = (np.clip(np.rint(y), 0, rows - 1).astype(int), np.clip(np.rint(x), 0, columns - 1).astype(int))
    return rgb, is_in_view(share, one.pose) & ~one.hidden[at] & (rgb.max(axis=-1) > 0)


def _picture(one: Taken, camera: PerspectiveCamera) -> tuple[np.ndarray, np.ndarray]:
    """The view of a camera as the panorama itself shows it, and where nothing stands before the block."""
    dense = PerspectiveCamera(camera.position, camera.target, camera.field_of_view, (SIDE * SAMPLES, SIDE * SAMPLES))
    rgb, _ = _sampled(one, dense.rays())
    return average_samples(rgb, SAMPLES), _sampled(one, camera.rays())[1]


def _projected(found: PublishedBlock, view: Seen, others: Sequence[Taken]) -> tuple[np.ndarray, np.ndarray]:
    """Each sample of a view from the nearest panorama that shows its place clear, else from the nearest with whatever stands
    before it: (h, w, 3) uint8; and which pixels (h, w) one shows clear."""
    hit, points = view.dense_chart != MISS, view.dense_points
    rgb = view.dense_rgb.copy()
    best = np.full(hit.shape, np.inf)
    shown = np.zeros(hit.shape, bool)
    for one in others:
        to = np.where(hit[..., None], points - camera_position(one.pose), 1.0)
        distance = np.linalg.norm(to, axis=-1)
        depth, _ = found.plan.scene.caster.cast(camera_position(one.pose), to / distance[..., None])
        colours, clear = _sampled(one, to)
        sees = (
            hit & (depth > distance - 2 * OCCLUSION_TOLERANCE_M) & (distance < FARTHEST_M) & (colours.max(axis=-1) > 0)
        )
        shown |= sees & clear
        worth = np.where(clear, distance, distance + FARTHEST_M)
        better = sees & (worth < best)
        rgb[better], best[better] = colours[better], worth[better]
    return average_samples(rgb, SAMPLES), shown[SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES]


def _compared(
    found: PublishedBlock,
    one: Taken,
    camera: PerspectiveCamera,
    ours: Seen,
    known: dict[str, Taken],
    taken: dict[str, Taken],
) -> Compared:
    """A view of the block without any panorama, as `found` has it, beside those of the others (known, at the poses of the run
    without the picture; taken, at those of the run with all) and the picture."""
    bare = _seen(found, camera)
    plain, shown = _projected(found, bare, list(known.values()))
    posed, _ = _projected(found, bare, [taken[name] for name in known])
    real, clear = _picture(one, camera)
    near = clear & (np.linalg.norm(bare.points - camera.position, axis=-1) < FARTHEST_M)
    regions = {
        f"{kind}, {whether}": there & where & near
        for kind, there in _kinds(found, bare.chart).items()
        for whether, where in (("shown", shown), ("not", ~shown))
    }
    return Compared(real, clear, dict(zip(MADE, (ours.rgb, plain, posed, bare.rgb), strict=True)), regions)


def _factor(views: Sequence[Compared], made: str) -> np.ndarray:
    """Factors (3,) that bring what was made to the exposure of the picture."""
    masks = [np.logical_or.reduce(list(view.regions.values())) for view in views]
    ours = np.concatenate([view.made[made][mask] for view, mask in zip(views, masks, strict=True)]).astype(np.float64)
    theirs = np.concatenate([view.real[mask] for view, mask in zip(views, masks, strict=True)])
    return np.asarray((ours * theirs).sum(axis=0) / np.maximum((ours**2).sum(axis=0), 1))


def _likeness(view: Compared, factors: dict[str, np.ndarray], mask: np.ndarray) -> dict[str, float]:
    """PSNR, SSIM and GMSD of what was made to the picture, where the mask says."""
    from skimage.metrics import structural_similarity

    told = {}
    for name, rgb in view.made.items():
        lit = rgb * factors[name]
        error = np.mean((lit[mask] - view.real[mask]) ** 2)
        told[f"{name} psnr"] = float(10 * np.log10(255**2 / max(error, 1e-9)))
        grey, truth = (one.astype(np.float64) @ [0.299, 0.587, 0.114] for one in (lit, view.real))
        _, every = structural_similarity(grey, truth, data_range=255, full=True)
        told[f"{name} ssim"] = float(every[mask].mean())
        told[f"{name} gmsd"] = float(_gradient_likeness(grey, truth)[mask].std())
    return told


def _gradient_likeness(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """That of two pictures (h, w), by Prewitt's gradients of means over two pixels, Xue et al. 2014, eq. 4."""
    across = np.array([[1, 0, -1]] * 3) / 3
    soft = [cv2.blur(one, (2, 2)) for one in (a, b)]
    one, two = (np.hypot(cv2.filter2D(s, -1, across), cv2.filter2D(s, -1, across.T)) for s in soft)
    return np.asarray((2 * one * two + _GMSD) / (one**2 + two**2 + _GMSD))


if __name__ == "__main__":
    main()
