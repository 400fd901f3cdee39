"""A photo of a facade as if taken from straight before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.extent import facade_extent
from facade_core.imagery.rectify.vanishing import FacadeCamera, distort, find_facade_camera
from facade_core.parsing.validation import check_image

# Lines are sought at this size of the longer side, and are at least this share of the half diagonal long.
WORKING_SIDE = 1500
SHORTEST = 0.02
LEAST_SIDE = 64
# Fewer segments than this along an axis are no facade; nor is a photo with a smaller share of its lines' length along both.
LEAST_SEGMENTS = 8
LEAST_SHARE = 0.3
# Degrees by which the axes' segments may miss in the result (median), and by how much its scale may vary in area.
MOST_RESIDUAL = 1.0
MOST_STRETCH = 60.0
# The result has no more pixels than this many times the photo's, nor a longer side.
MOST_PIXELS = 1.5
LONGEST = 8192

REMEDY = "take it from nearer the front, with the whole facade in view, or leave it out"


@dataclass(frozen=True, slots=True, eq=False)
class Rectified:
    """A facade seen from straight before it.

    image (h, w, 3) uint8 RGB; homography (3, 3) float64 takes photo pixels to its pixels (x right, y down, whole numbers at
    pixel centres): image is the photo warped by it, black where seen (h, w) bool is False: outside the photo, or hidden by
    alpha. focal in photo pixels, given or found; residual, the median angle in degrees that is left between the facade's lines
    and the image's axes.
    """

    image: np.ndarray
    homography: np.ndarray
    seen: np.ndarray
    focal: float
    residual: float


def rectify(photo: np.ndarray, *, focal: float | None = None) -> Rectified:
    """The dominant facade of a photo, cut out of it and rectified, with width and height in their true proportion.

    photo (H, W, 3) uint8 RGB, or (H, W, 4), whose alpha hides. The principal point is taken to be the centre. focal in pixels
    (from EXIF); None: found from the vanishing points, as far as they tell, between them and a 31 mm equivalent. Radial
    distortion is estimated, but what comes back is the homography that is nearest to the whole map. A photo that is rectified
    already keeps its full extent. Raises ImageError for an image of another kind, and, with the reason, where no facade is
    found that can be rectified reliably.
    """
    check_image(photo)
    if min(photo.shape[:2]) < LEAST_SIDE:
        raise ImageError(
            f"photo: {photo.shape[1]} x {photo.shape[0]} pixels are too few; give one of {LEAST_SIDE} or more"
        )
    if focal is not None and not (np.isfinite(focal) and focal > 0):
        raise ImageError(f"photo: a focal length of {focal} pixels is none; leave it out to have it estimated")
    half = np.hypot(*photo.shape[:2]) / 2
    centre = (np.array(photo.shape[1::-1]) - 1) / 2
    segments, pixel = _segments(photo, half, centre)
    if len(segments) < 2 * LEAST_SEGMENTS:
        raise ImageError(f"photo: only {len(segments)} straight lines, too few for a facade; {REMEDY}")
    view = find_facade_camera(segments, pixel, None if focal is None else focal / half)
    if view is None:
        raise ImageError(f"photo: its lines agree on no facade that a camera before it would see; {REMEDY}")
    _check_view(view, segments)
    height, width = photo.shape[:2]
    corners = (np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5 - centre) / half
    box = facade_extent(segments, view, corners)
    if box is None:
        raise ImageError(f"photo: too few lines along both axes of a facade lie together; {REMEDY}")
    homography, size = _homography(view, box, corners, half, centre)
    residual = _check_result(segments * half + centre, view.family, homography, size)
    image, seen = _warp(photo, homography, size)
    return Rectified(image, homography, seen, view.focal * half, residual)


def _segments(photo: np.ndarray, half: float, centre: np.ndarray) -> tuple[np.ndarray, float]:
    """Straight lines (n, 2, 2) of a photo in half diagonals from its centre, and the size of a pixel as searched."""
    import cv2

    scale = min(1.0, WORKING_SIDE / max(photo.shape[:2]))
    size = tuple(max(1, round(side * scale)) for side in photo.shape[1::-1])
    small = cv2.resize(photo, size, interpolation=cv2.INTER_AREA) if scale < 1 else photo
    grey = cv2.cvtColor(np.ascontiguousarray(small[..., :3]), cv2.COLOR_RGB2GRAY)
    if grey.max() == grey.min():
        return np.empty((0, 2, 2)), 1.0
    found = cv2.createLineSegmentDetector().detect(grey)[0]
    if found is None:
        return np.empty((0, 2, 2)), 1.0
    ends = np.asarray(found, np.float64).reshape(-1, 2, 2)
    if photo.shape[2] == 4:
        # A cut-out's own outline is no line of the facade.
        hidden = cv2.dilate((small[..., 3] < 128).astype(np.uint8), np.ones((7, 7), np.uint8)).astype(np.bool_)
        at = np.clip(np.round(ends.mean(axis=1)).astype(int), 0, np.array(size) - 1)
        ends = ends[~hidden[at[:, 1], at[:, 0]]]
    # Centres of pixels at whole numbers, before and after.
    ends = ((ends + 0.5) * (np.array(photo.shape[1::-1]) / size) - 0.5 - centre) / half
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) >= SHORTEST]
    return ends, 1.0 / (half * scale)


def _check_view(view: FacadeCamera, segments: np.ndarray) -> None:
    """Raise ImageError for a view that too little speaks for, ."""
    across, upright = int((view.family == 0).sum()), int((view.family == 1).sum())
    if min(across, upright) < LEAST_SEGMENTS:
        raise ImageError(
            f"photo: {across} lines along a facade's horizontal and {upright} along its vertical are too few; {REMEDY}"
        )
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    share = lengths[view.family >= 0].sum() / lengths.sum()
    if share < LEAST_SHARE:
        raise ImageError(f"photo: only {share:.0%} of its lines agree on a facade's two directions; {REMEDY}")


def _homography(
    view: FacadeCamera, box: tuple[float, float, float, float], corners: np.ndarray, half: float, centre: np.ndarray
) -> tuple[np.ndarray, tuple[int, int]]:
    """The map from photo to result pixels, and the result's (height, width): as many pixels as the photo has of the facade."""
    import cv2

    x0, y0, x1, y1 = box
    plane = np.stack(np.meshgrid(np.linspace(x0, x1, 33), np.linspace(y0, y1, 33)), axis=-1)
    rays = np.concatenate([plane, np.ones((33, 33, 1))], axis=-1) @ view.rotation.T
    before = rays[..., 2] > 0.05
    straight = rays[..., :2] / np.where(before, rays[..., 2], 1.0)[..., None] * view.focal
    photo = distort(straight, view.distortion)
    inside = before & (photo >= corners[0]).all(axis=-1) & (photo <= corners[2]).all(axis=-1)
    if inside.sum() < 16:
        raise ImageError(f"photo: the facade lies almost outside it; {REMEDY}")
    # Area of the photo per area of the plane at a point is the camera's focal^2 / depth^3 of the unit ray.
    density = (view.focal * half) ** 2 / rays[inside][:, 2] ** 3
    if density.max() / density.min() > MOST_STRETCH:
        raise ImageError(f"photo: the facade is seen too obliquely to be flattened; {REMEDY}")
    photo_area = half**2 * float(np.prod(corners[2] - corners[0]))
    area = (x1 - x0) * (y1 - y0)
    scale = min(
        float(np.sqrt(density.mean())), float(np.sqrt(MOST_PIXELS * photo_area / area)), LONGEST / max(x1 - x0, y1 - y0)
    )
    size = max(1, round((y1 - y0) * scale)), max(1, round((x1 - x0) * scale))
    target = (plane - [x0, y0]) * scale - 0.5
    homography, _ = cv2.findHomography(photo[inside] * half + centre, target[inside], 0)
    return homography, size


def _check_result(segments: np.ndarray, family: np.ndarray, homography: np.ndarray, size: tuple[int, int]) -> float:
    """The residual in degrees of the lines (n, 2, 2; photo pixels) in the result; ImageError where it is a wild warp."""
    if min(size) < LEAST_SIDE // 2 or max(size) > 20 * min(size):
        raise ImageError(f"photo: its facade would come out as {size[1]} x {size[0]} pixels; {REMEDY}")
    ends = np.concatenate([segments, np.ones((len(segments), 2, 1))], axis=2) @ homography.T
    fine = (family >= 0) & (ends[..., 2] > 0).all(axis=1)
    flat = ends[fine, :, :2] / ends[fine, :, 2:]
    inside = ((flat.mean(axis=1) >= 0) & (flat.mean(axis=1) < size[::-1])).all(axis=1)
    step, own = (flat[:, 1] - flat[:, 0])[inside], family[fine][inside]
    missed = np.abs(np.where(own == 0, step[:, 1], step[:, 0]))
    angle = np.degrees(np.arctan2(missed, np.abs(np.where(own == 0, step[:, 0], step[:, 1]))))
    if min((own == 0).sum(), (own == 1).sum()) < LEAST_SEGMENTS:
        raise ImageError(f"photo: too few lines along both axes lie on the facade itself; {REMEDY}")
    residual = float(np.median(angle))
    if residual > MOST_RESIDUAL:
        raise ImageError(f"photo: its lines would still be {residual:.1f} degrees off the axes; {REMEDY}")
    return residual


def _warp(photo: np.ndarray, homography: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    import cv2

    shown = photo[..., 3] >= 128 if photo.shape[2] == 4 else np.ones(photo.shape[:2], np.bool_)
    image = cv2.warpPerspective(np.ascontiguousarray(photo[..., :3]), homography, size[::-1], flags=cv2.INTER_LINEAR)
    seen = cv2.warpPerspective(shown.astype(np.uint8) * 255, homography, size[::-1], flags=cv2.INTER_LINEAR) >= 250
    image[~seen] = 0
    return image, seen
