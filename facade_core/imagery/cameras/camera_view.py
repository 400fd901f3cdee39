"""Panoramas as cameras, and a chart as several cameras see it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, IntArray, UInt8Array
from facade_core.core.types import Pose
from facade_core.imagery.cameras.settings import CAMERA_VIEWS
from facade_core.imagery.rectify.fusion import ChartView, fuse_views


@dataclass(frozen=True, slots=True, eq=False)
class PanoramaCamera:
    """Panorama with its pose, occluders and exposure.

    Attributes
    ----------
    image : (H, W, 3) uint8 RGB.
    pose : pose of the camera.
    occluded : (H, W) bool, an occluder is seen.
    exposure_factor : (3,) factors to the common exposure.
    ground_colour : typical ground colour around the camera, see `typical_ground_colour`.
    private : (H, W) bool, the part of `occluded` that shows faces and number plates; None without any.
    """

    image: UInt8Array
    pose: Pose
    occluded: BoolArray
    exposure_factor: Float64Array
    ground_colour: tuple[Float64Array, Float64Array] | None
    private: BoolArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FusedCameraView:
    """Chart fused from the views of several panorama cameras.

    Attributes
    ----------
    rgb : (h, w, 3) uint8.
    is_visible : (h, w) bool, a camera shows the texel.
    camera : (h, w) int8 index of that camera, -1 for none.
    confidence : (h, w) float32, share of the raster's resolution times the sine of the viewing angle.
    """

    rgb: UInt8Array
    is_visible: BoolArray
    camera: IntArray
    confidence: Float32Array


def apply_exposure_factor(rgb: UInt8Array, factor: Float64Array) -> UInt8Array:
    """Multiply a picture (h, w, 3) by a factor (3,)."""
    light: UInt8Array = np.clip(rgb * factor.astype(np.float32) + 0.5, 0, 255).astype(np.uint8)
    return light


def equalise_exposure(view: ChartView, camera: PanoramaCamera, mask: BoolArray) -> ChartView:
    """Convert a camera's view to the common exposure, limited to the texels of a mask.

    Parameters
    ----------
    view : chart as the camera shows it.
    camera : camera with its exposure factors.
    mask : (h, w) bool, texels to keep.

    Returns
    -------
    The view in the common exposure.
    """
    seen = view.seen & mask
    rgb = apply_exposure_factor(view.rgb, camera.exposure_factor)
    return ChartView(rgb, seen, view.quality * seen, None if view.occluded is None else view.occluded & seen)


def fuse_camera_views(
    views: Sequence[ChartView], trusted: Sequence[BoolArray], density: float
) -> FusedCameraView | None:
    """Fuse the trusted texels of views of one exposure; seams run where they show least.

    Parameters
    ----------
    views : views of one chart, of equal size.
    trusted : (h, w) bool per view, texels that may be used.
    density : texels per metre.

    Returns
    -------
    The fused view, None where too little is left.
    """
    views = [replace(view, occluded=view.seen & ~is_trusted) for view, is_trusted in zip(views, trusted, strict=True)]
    fused = fuse_views(views, exposures_match=True)
    is_visible = _drop_small_pieces(fused.seen & ~fused.occluded, density)
    if not is_visible.any():
        return None
    source = np.where(is_visible, fused.source, np.int8(-1)).astype(np.int8)
    return FusedCameraView(
        np.where(is_visible[..., None], fused.rgb, 0), is_visible, source, fused.confidence * is_visible
    )


def _drop_small_pieces(is_visible: BoolArray, density: float) -> BoolArray:
    """Remove pieces that are too narrow or too small."""
    import cv2
    from skimage.morphology import remove_small_objects

    side = max(1, round(CAMERA_VIEWS.min_piece_width_m * density))
    narrow = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    # replicated border: a piece that the raster's border cuts continues on the next chart
    padded = cv2.copyMakeBorder(is_visible.astype(np.uint8), side, side, side, side, cv2.BORDER_REPLICATE)
    opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, narrow)[side:-side, side:-side] > 0
    kept: BoolArray = remove_small_objects(opened & is_visible, max_size=round(CAMERA_VIEWS.min_piece_m2 * density**2))
    return kept
