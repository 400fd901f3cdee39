"""Views of a textured mesh from where the panorama held out was taken, and how like it they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.mesh_texturing.cases import UNSEEN_GREY, Case, Panorama
from benchmarks.mesh_texturing.views import cut_view, perspective_cameras
from facade_core.export.pictures.rendering import average_samples
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS
from facade_core.imagery.panorama_camera import camera_position, is_in_view, project_directions_to_picture

# Pixels to a side of a view, and rays along each side of a pixel.
SIDE_PX, SAMPLES = 480, 2
# Farther surfaces are not compared, metres.
MAX_DISTANCE_M = 100.0
# How far in front of a surface a ray may end that still reaches it, metres.
TOLERANCE_M = 0.1

# Rays' places on the block: origin (3,), rays (h, w, 3), chart (h, w), points (h, w, 3) -> colours (h, w, 3) uint8.
Sampler = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class ComparedView:
    """View of the panorama held out, and of each texture.

    Attributes
    ----------
    truth : (h, w, 3) uint8.
    made : by method, (h, w, 3) uint8.
    regions : by name, (h, w) bool.
    """

    truth: np.ndarray
    made: dict[str, np.ndarray]
    regions: dict[str, np.ndarray]


def chart_sampler(case: Case, rasters: Mapping[int, np.ndarray]) -> Sampler:
    """Return a sampler of the rasters of charts, bilinear as that of a mesh."""
    charts, density = case.scene.charts, case.scene.placement.texels_per_metre

    def sample(_origin: np.ndarray, _rays: np.ndarray, chart: np.ndarray, points: np.ndarray) -> np.ndarray:
        rgb = np.full(points.shape, UNSEEN_GREY, np.uint8)
        for one in np.unique(chart[chart != MISS]).tolist():
            here = chart == one
            place = charts.coordinates(np.full(int(here.sum()), one), points[here]) * density[one] - 0.5
            x, y = place.astype(np.float32).T[:, None]
            rgb[here] = _remap(rasters[one], x, y)
        return rgb

    return sample


def _remap(raster: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return colours (n, 3) of a raster at places (1, n), in blocks as OpenCV takes at most 32767 columns."""
    count = x.shape[1]
    side = int(np.ceil(np.sqrt(max(1, count))))
    x, y = (np.pad(one.ravel(), (0, side * side - count)).reshape(side, side) for one in (x, y))
    found = cv2.remap(raster, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found.reshape(-1, 3)[:count]


def compare_views(case: Case, samplers: Mapping[str, Sampler]) -> list[ComparedView]:
    """Return the views around the panorama held out, straight ahead, as it and each texture show them."""
    held, views = case.held_out, []
    for camera in perspective_cameras(held.pose, SIDE_PX, pitches=(0.0,)):
        dense = replace(camera, size=(SIDE_PX * SAMPLES, SIDE_PX * SAMPLES))
        rays = dense.rays()
        depth, chart = case.scene.caster.cast(dense.position, rays)
        points = dense.position + np.where(chart != MISS, depth, 0.0)[..., None] * rays
        made = {
            name: average_samples(sampler(dense.position, rays, chart, points), SAMPLES)
            for name, sampler in samplers.items()
        }
        middle = (slice(SAMPLES // 2, None, SAMPLES),) * 2
        truth = average_samples(cut_view(held.image, held.pose, rays), SAMPLES)
        views.append(ComparedView(truth, made, _regions(case, rays[middle], depth[middle], chart[middle])))
    return views


def _regions(case: Case, rays: np.ndarray, depth: np.ndarray, chart: np.ndarray) -> dict[str, np.ndarray]:
    """Return walls with roofs, roofs, and ground: where a camera shows them with nothing in front, and everywhere."""
    held = case.held_out
    there = (chart != MISS) & (depth < MAX_DISTANCE_M) & ~_occluded(held, rays)
    points = camera_position(held.pose) + np.where(there, depth, 1.0)[..., None] * rays
    seen = np.zeros_like(there)
    for one in case.taken:
        to = points - camera_position(one.pose)
        distance = np.linalg.norm(to, axis=-1)
        reached, _ = case.scene.caster.cast(camera_position(one.pose), to / distance[..., None])
        seen |= (reached > distance - TOLERANCE_M) & (distance < MAX_DISTANCE_M) & ~_occluded(one, to)
    ground = case.scene.charts.kind[chart] == ChartKind.GROUND
    roof = case.scene.charts.kind[chart] == ChartKind.ROOF
    kinds = {"walls": there & ~ground, "ground": there & ground, "roofs": there & roof}
    return {
        f"{kind}, {where}": mask & (seen if where == "seen" else True)
        for kind, mask in kinds.items()
        for where in ("seen", "everywhere")
    }


def _occluded(one: Panorama, rays: np.ndarray) -> np.ndarray:
    """Return where something hides the block on a panorama along rays, or the panorama ends there."""
    mask, pose = one.occluded, one.pose
    share = project_directions_to_picture(rays, pose)
    left, top, width, height = pose.view
    rows, columns = mask.shape
    inside = is_in_view(share, pose)
    share = np.where(inside[..., None], share, 0.0)
    column = ((share[..., 0] - left) % 1.0 / width * columns).astype(int).clip(0, columns - 1)
    row = ((share[..., 1] - top) / height * rows).astype(int).clip(0, rows - 1)
    return np.asarray(mask[row, column] | ~inside)


def measure_likeness(views: Sequence[ComparedView]) -> dict[str, dict[str, object]]:
    """Return by region its share of the views, and by method PSNR in dB and SSIM, a factor a channel aside."""
    from skimage.metrics import structural_similarity

    told: dict[str, dict[str, object]] = {}
    lit: dict[str, list[np.ndarray]] = {}
    for name in views[0].made:
        masks = [view.regions["walls, everywhere"] | view.regions["ground, everywhere"] for view in views]
        ours, truth = (
            np.concatenate([image[mask] for image, mask in zip(images, masks, strict=True)]).astype(float)
            for images in ([view.made[name] for view in views], [view.truth for view in views])
        )
        factor = (ours * truth).sum(axis=0) / np.maximum((ours**2).sum(axis=0), 1)
        lit[name] = [view.made[name] * factor for view in views]
    grey = np.array([0.299, 0.587, 0.114])
    for region in views[0].regions:
        masks = [view.regions[region] for view in views]
        told[region] = {"share": round(float(np.mean(masks)), 4)}
        if not np.any(masks):
            continue
        for name, images in lit.items():
            errors, likeness = [], []
            for view, image, mask in zip(views, images, masks, strict=True):
                errors.append(((image - view.truth)[mask] ** 2).ravel())
                pair = (image @ grey, view.truth @ grey)
                likeness.append(structural_similarity(*pair, data_range=255, full=True)[1][mask])
            psnr = 10 * np.log10(255**2 / max(float(np.concatenate(errors).mean()), 1e-9))
            told[region][name] = [round(float(psnr), 2), round(float(np.concatenate(likeness).mean()), 3)]
    return told
