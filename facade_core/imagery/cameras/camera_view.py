"""A panorama as a camera, and a chart as several of them show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.types import Pose
from facade_core.imagery.rectify.fusion import View, fuse_views

# Pieces smaller than this are left to the material, square metres, as is what is narrower, metres.
LEAST_M2, NARROW_M = 2.0, 0.6


@dataclass(frozen=True, slots=True, eq=False)
class PanoramaCamera:
    """A posed panorama: image (H, W, 3) uint8, its pose, what of it is hidden (H, W) bool, the factors (3,) to its exposure,
    and what the ground around it usually looks like, as of `typical_ground_colour`."""

    image: np.ndarray
    pose: Pose
    occluded: np.ndarray
    exposure_factor: np.ndarray
    ground_colour: tuple[np.ndarray, np.ndarray] | None


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A chart as cameras show it: rgb (h, w, 3) uint8; shown (h, w) bool, where they do; camera (h, w) int8, which of them,
    -1 none; confidence (h, w) float32, the share of the raster's resolution that it has, times the sine of its angle."""

    rgb: np.ndarray
    is_visible: np.ndarray
    camera: np.ndarray
    confidence: np.ndarray


def equalise_exposure(view: View, camera: PanoramaCamera, mask: np.ndarray) -> View:
    """A view by a camera in the exposure of all, of the texels `within` (h, w) bool."""
    seen = view.seen & mask
    rgb = np.clip(view.rgb * camera.exposure_factor.astype(np.float32) + 0.5, 0, 255).astype(np.uint8)
    return View(rgb, seen, view.quality * seen, None if view.occluded is None else view.occluded & seen)


def fuse_camera_views(views: Sequence[View], trusted: Sequence[np.ndarray], density: float) -> CameraView | None:
    """A chart from views of one exposure, by what is believed (h, w) bool of each; None where that is too little. Seams between
    cameras run where they show least. density in texels per metre."""
    views = [replace(view, occluded=view.seen & ~kept) for view, kept in zip(views, trusted, strict=True)]
    fused = fuse_views(views, matched=True)
    shown = _whole(fused.seen & ~fused.occluded, density)
    if not shown.any():
        return None
    source = np.where(shown, fused.source, np.int8(-1)).astype(np.int8)
    return CameraView(np.where(shown[..., None], fused.rgb, 0), shown, source, fused.confidence * shown)


def _whole(shown: np.ndarray, density: float) -> np.ndarray:
    """What is shown (h, w) bool without what is too narrow or too small."""
    import cv2
    from skimage.morphology import remove_small_objects

    side = max(1, round(NARROW_M * density))
    narrow = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    # what the raster's border cuts goes on on the next chart
    padded = cv2.copyMakeBorder(shown.astype(np.uint8), side, side, side, side, cv2.BORDER_REPLICATE)
    opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, narrow)[side:-side, side:-side] > 0
    return remove_small_objects(opened & shown, max_size=round(LEAST_M2 * density**2))
