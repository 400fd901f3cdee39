"""Rectification of a facade photo to a frontal view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.fixed_order import multiply_matrices
from facade_core.imagery.rectify.corner import find_corner
from facade_core.imagery.rectify.extent import facade_extent
from facade_core.imagery.rectify.line_segments import detect_segments_in_grey
from facade_core.imagery.rectify.settings import RECTIFICATION
from facade_core.imagery.rectify.vanishing import FacadeCamera, distort, find_facade_camera
from facade_core.parsing.validation import check_image

REMEDY = "take it from nearer the front, with the whole facade in view, or leave it out"


@dataclass(frozen=True, slots=True, eq=False)
class Rectified:
    """Frontal view of a facade.

    Attributes
    ----------
    image : (h, w, 3) uint8 RGB, the photo warped by the homography, black where not seen.
    homography : (3, 3) float64 from photo pixels to image pixels (x right, y down, whole numbers at pixel centres).
    seen : (h, w) bool, False outside the photo or where alpha hides it.
    focal : focal length in photo pixels, stated or estimated.
    residual : median angle in degrees between the facade's lines and the image's axes.
    other_facade : side on which another facade of the building is seen around a corner; None without one.
    """

    image: UInt8Array
    homography: Float64Array
    seen: BoolArray
    focal: float
    residual: float
    other_facade: Literal["left", "right"] | None = None


def rectify(photo: UInt8Array, *, focal: float | None = None) -> Rectified:
    """Rectify the dominant facade of a photo and crop to it, with true proportions.

    The principal point is the photo's centre. Radial distortion is estimated; the result is the homography nearest to
    the whole map. A photo that is already rectified keeps its full extent.

    Parameters
    ----------
    photo : (H, W, 3) uint8 RGB, or (H, W, 4) with alpha that hides.
    focal : focal length in pixels, from EXIF; None estimates it from the vanishing points and an expected 31 mm
        equivalent.

    Raises
    ------
    ImageError
        If the image is of another kind, or no facade can be rectified reliably; the message gives the reason.
    """
    check_image(photo)
    if min(photo.shape[:2]) < RECTIFICATION.min_photo_side:
        raise ImageError(
            f"photo: {photo.shape[1]} x {photo.shape[0]} pixels are too few; give one of {RECTIFICATION.min_photo_side} or more"
        )
    if focal is not None and not (np.isfinite(focal) and focal > 0):
        raise ImageError(f"photo: a focal length of {focal} pixels is none; leave it out to have it estimated")
    half = np.hypot(*photo.shape[:2]) / 2
    centre = (np.array(photo.shape[1::-1]) - 1) / 2
    segments, pixel = _detect_segments(photo, half, centre)
    if len(segments) < 2 * RECTIFICATION.min_segments:
        raise ImageError(f"photo: only {len(segments)} straight lines, too few for a facade; {REMEDY}")
    view = find_facade_camera(segments, pixel, None if focal is None else focal / half)
    if view is None:
        raise ImageError(f"photo: its lines agree on no facade that a camera before it would see; {REMEDY}")
    _check_view(view, segments)
    height, width = photo.shape[:2]
    corners = (np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5 - centre) / half
    corner = find_corner(segments, view)
    box = facade_extent(segments, view, corners, corner)
    if box is None:
        raise ImageError(f"photo: too few lines along both axes of a facade lie together; {REMEDY}")
    homography, size = _homography(view, box, corners, half, centre)
    residual = _check_result(segments * half + centre, view.family, homography, size)
    image, seen = _warp(photo, homography, size)
    return Rectified(image, homography, seen, view.focal * half, residual, corner and corner.side)


def _detect_segments(photo: UInt8Array, half: float, centre: Float64Array) -> tuple[Float64Array, float]:
    """Straight lines (n, 2, 2) of a photo in half diagonals from its centre, and the size of a searched pixel."""
    import cv2

    scale = min(1.0, RECTIFICATION.working_side / max(photo.shape[:2]))
    size = tuple(max(1, round(side * scale)) for side in photo.shape[1::-1])
    small = cv2.resize(photo, size, interpolation=cv2.INTER_AREA) if scale < 1 else photo
    grey = cv2.cvtColor(np.ascontiguousarray(small[..., :3]), cv2.COLOR_RGB2GRAY)
    ends = detect_segments_in_grey(grey)
    if photo.shape[2] == 4:
        # The outline of a cut-out is no line of the facade.
        hidden = cv2.dilate((small[..., 3] < 128).astype(np.uint8), np.ones((7, 7), np.uint8)).astype(np.bool_)
        pixel = np.clip(np.round(ends.mean(axis=1)).astype(int), 0, np.array(size) - 1)
        ends = ends[~hidden[pixel[:, 1], pixel[:, 0]]]
    # Pixel centres are at whole numbers, before and after.
    ends = ((ends + 0.5) * (np.array(photo.shape[1::-1]) / size) - 0.5 - centre) / half
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) >= RECTIFICATION.min_line_length]
    return ends, 1.0 / (half * scale)


def _check_view(view: FacadeCamera, segments: Float64Array) -> None:
    """Raise ImageError for a camera with too little support."""
    across, upright = int((view.family == 0).sum()), int((view.family == 1).sum())
    if min(across, upright) < RECTIFICATION.min_segments:
        raise ImageError(
            f"photo: {across} lines along a facade's horizontal and {upright} along its vertical are too few; {REMEDY}"
        )
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    share = lengths[view.family >= 0].sum() / lengths.sum()
    if share < RECTIFICATION.min_axis_share:
        raise ImageError(f"photo: only {share:.0%} of its lines agree on a facade's two directions; {REMEDY}")


def _homography(
    view: FacadeCamera, box: tuple[float, float, float, float], corners: Float64Array, half: float, centre: Float64Array
) -> tuple[Float64Array, tuple[int, int]]:
    """Map from photo to result pixels, and the result's height and width, at the photo's resolution of the facade."""
    import cv2

    x0, y0, x1, y1 = box
    plane = np.stack(np.meshgrid(np.linspace(x0, x1, 33), np.linspace(y0, y1, 33)), axis=-1)
    rays = multiply_matrices(np.concatenate([plane, np.ones((33, 33, 1))], axis=-1), view.rotation.T)
    in_front = rays[..., 2] > 0.05
    straight = rays[..., :2] / np.where(in_front, rays[..., 2], 1.0)[..., None] * view.focal
    photo = distort(straight, view.distortion)
    inside = in_front & (photo >= corners[0]).all(axis=-1) & (photo <= corners[2]).all(axis=-1)
    if inside.sum() < 16:
        raise ImageError(f"photo: the facade lies almost outside it; {REMEDY}")
    # Area of the photo per area of the plane at a point is the camera's focal^2 / depth^3 of the unit ray.
    density = (view.focal * half) ** 2 / rays[inside][:, 2] ** 3
    if density.max() / density.min() > RECTIFICATION.max_area_ratio:
        raise ImageError(f"photo: the facade is seen too obliquely to be flattened; {REMEDY}")
    photo_area = half**2 * float(np.prod(corners[2] - corners[0]))
    area = (x1 - x0) * (y1 - y0)
    scale = min(
        float(np.sqrt(density.mean())),
        float(np.sqrt(RECTIFICATION.max_pixel_ratio * photo_area / area)),
        RECTIFICATION.max_result_side / max(x1 - x0, y1 - y0),
    )
    size = max(1, round((y1 - y0) * scale)), max(1, round((x1 - x0) * scale))
    target = (plane - [x0, y0]) * scale - 0.5
    homography, _ = cv2.findHomography(photo[inside] * half + centre, target[inside], 0)
    return homography, size


def _check_result(segments: Float64Array, family: AnyArray, homography: Float64Array, size: tuple[int, int]) -> float:
    """Residual in degrees of the lines (n, 2, 2; photo pixels) in the result; ImageError for a wild warp."""
    if min(size) < RECTIFICATION.min_photo_side // 2 or max(size) > 20 * min(size):
        raise ImageError(f"photo: its facade would come out as {size[1]} x {size[0]} pixels; {REMEDY}")
    ends = multiply_matrices(np.concatenate([segments, np.ones((len(segments), 2, 1))], axis=2), homography.T)
    is_in_front = (family >= 0) & (ends[..., 2] > 0).all(axis=1)
    flat = ends[is_in_front, :, :2] / ends[is_in_front, :, 2:]
    inside = ((flat.mean(axis=1) >= 0) & (flat.mean(axis=1) < size[::-1])).all(axis=1)
    step, own_family = (flat[:, 1] - flat[:, 0])[inside], family[is_in_front][inside]
    missed = np.abs(np.where(own_family == 0, step[:, 1], step[:, 0]))
    angle = np.degrees(np.arctan2(missed, np.abs(np.where(own_family == 0, step[:, 0], step[:, 1]))))
    if min((own_family == 0).sum(), (own_family == 1).sum()) < RECTIFICATION.min_segments:
        raise ImageError(f"photo: too few lines along both axes lie on the facade itself; {REMEDY}")
    residual = float(np.median(angle))
    if residual > RECTIFICATION.max_residual_deg:
        raise ImageError(f"photo: its lines would still be {residual:.1f} degrees off the axes; {REMEDY}")
    return residual


def _warp(photo: UInt8Array, homography: Float64Array, size: tuple[int, int]) -> tuple[UInt8Array, BoolArray]:
    import cv2

    is_opaque = photo[..., 3] >= 128 if photo.shape[2] == 4 else np.ones(photo.shape[:2], np.bool_)
    image = cv2.warpPerspective(np.ascontiguousarray(photo[..., :3]), homography, size[::-1], flags=cv2.INTER_LINEAR)
    seen = cv2.warpPerspective(is_opaque.astype(np.uint8) * 255, homography, size[::-1], flags=cv2.INTER_LINEAR) >= 250
    image[~seen] = 0
    return np.asarray(image, np.uint8), seen
