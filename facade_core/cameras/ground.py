"""Ground charts from posed panoramas: each texel from the camera that shows it best, where cameras agree on what it is.

What is not in the model (cars, people, kerbs, the camera's own vehicle) lies elsewhere on the ground for each camera, by
parallax: squares in which cameras contradict each other are left to the material.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.atlas.levelling import spread
from facade_core.rectify.camera import GROUND_REACH_M, position
from facade_core.rectify.fusion import View, fuse_views
from facade_core.rectify.panorama import rectify_view
from facade_core.street.scene import Scene
from facade_core.types import Pose

# A camera shows ground from so near, metres: nearer its own vehicle is in the way.
NEAR_M = 3.4
# What one camera alone shows nearer than this may be its own vehicle, metres.
ALONE_M = 7.0
# A camera is believed where it is alone if so many squares of the piece, and this share of those that it shows with others,
# are agreed on: no camera without neighbours is, whose ground would be a ring around it.
VOUCHED, VOUCHED_SHARE = 24, 0.5
# Side of the squares by which cameras are compared, metres, and how far apart their colours may be, as logarithms of their
# ratio: what is the same ground in two pictures of one exposure is within it.
SQUARE_M, APART = 0.5, 0.22
# What one camera alone shows is ground where it is no farther off the usual colour around that camera than this, or than so
# many times what half of the ground is off.
ODD, OFTEN = 0.35, 3.0
# A square of which less is clear is not compared.
LEAST_CLEAR = 0.25
# Side of the cells in which thin things are looked for, metres: trunks, posts, cables, of which a square is not. One is as far
# off the median of so much around it as this, as a logarithm, and goes with a rim of so many cells, unless another camera shows
# that colour within as many cells.
THIN_M, BESIDE_M, THIN, RIM = 0.125, 1.6, 0.3, 2
# Pieces smaller than this are left to the material, square metres, as is what is narrower, metres.
LEAST_M2, NARROW_M = 2.0, 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A posed panorama: image (H, W, 3) uint8, its pose, what of it is hidden (H, W) bool, the factors (3,) to its exposure,
    and what the ground around it usually looks like, as of `usual_of`."""

    image: np.ndarray
    pose: Pose
    hidden: np.ndarray
    factor: np.ndarray
    usual: tuple[np.ndarray, np.ndarray] | None


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A chart as cameras show it: rgb (h, w, 3) uint8; shown (h, w) bool, where they do; camera (h, w) int8, which of them,
    -1 none; confidence (h, w) float32, the share of the raster's resolution that it has, times the sine of its angle."""

    rgb: np.ndarray
    shown: np.ndarray
    camera: np.ndarray
    confidence: np.ndarray


def photographed(scene: Scene, chart: int, cameras: Sequence[Camera]) -> Shown | None:
    """A chart of the ground from panoramas; None where they show too little.

    A square that several cameras show is taken from those that agree with another one; what one alone shows is taken where it
    is far enough from the camera and of the usual colour, and others agree with that camera beside it. Seams between cameras
    run where they show least.
    """
    views = [_view(scene, chart, camera) for camera in cameras]
    if not any(bool(view.clear.any()) for view in views):
        return None
    density = float(scene.placement.texels_per_metre[chart])
    away = [_away(scene, chart, camera.pose) for camera in cameras]
    kept = believed(views, away, [_usual(camera) for camera in cameras], density)
    views = [
        replace(view, occluded=view.seen & ~believed_here) for view, believed_here in zip(views, kept, strict=True)
    ]
    fused = fuse_views(views, matched=True)
    shown = _whole(fused.seen & ~fused.occluded, density)
    if not shown.any():
        return None
    source = np.where(shown, fused.source, np.int8(-1)).astype(np.int8)
    return Shown(np.where(shown[..., None], fused.rgb, 0), shown, source, fused.confidence * shown)


def believed(
    views: Sequence[View],
    away: Sequence[np.ndarray],
    usual: Sequence[tuple[np.ndarray, np.ndarray] | None],
    density: float,
) -> list[np.ndarray]:
    """Which clear texels of each view are believed, (h, w) bool each.

    away (h, w): metres from the camera; usual: as of `usual_of`, in the views' exposure; density in texels per metre.
    """
    side = max(1, round(SQUARE_M * density))
    clear = np.stack([_means(view.clear.astype(np.float32), side) for view in views])
    logs = np.stack([_logs(view, side) for view in views])
    there = clear > LEAST_CLEAR
    supported, opposed = np.zeros(there.shape, bool), np.zeros(there.shape, bool)
    for i in range(len(views)):
        for j in range(len(views)):
            if i == j:
                continue
            both = there[i] & there[j]
            agree = both & _near(logs[i], logs[j], there[j]) & _near(logs[j], logs[i], there[i])
            supported[i] |= agree
            opposed[i] |= both & ~agree
    kept = []
    for i, view in enumerate(views):
        alone = there[i] & ~supported[i] & ~opposed[i]
        like = usual[i]
        agreed = int(supported[i].sum())
        if like is None or agreed < VOUCHED or agreed < VOUCHED_SHARE * (supported[i] | opposed[i]).sum():
            alone[:] = False
        else:
            middle, half = like
            alone &= (np.abs(logs[i] - middle) <= np.maximum(ODD, OFTEN * half)).all(axis=2)
        whole = [_on_texels(square, side, view.seen.shape) for square in (supported[i], alone)]
        kept.append(view.clear & (whole[0] | (whole[1] & (away[i] >= ALONE_M))))
    return [one & ~thin for one, thin in zip(kept, _thin(views, density), strict=True)]


def _thin(views: Sequence[View], density: float) -> list[np.ndarray]:
    """Texels (h, w) bool of each view that stand out from the ground around them, which no other view confirms."""
    import cv2

    side = max(1, round(THIN_M * density))
    window = 2 * round(BESIDE_M / THIN_M / 2) + 1
    there = [_means(view.clear.astype(np.float32), side) > LEAST_CLEAR for view in views]
    logs = [_logs(view, side) for view in views]
    found = []
    for i, view in enumerate(views):
        colour = np.rint(spread(np.exp(logs[i]), there[i])).clip(1, 255).astype(np.uint8)
        usual = np.log(np.maximum(cv2.medianBlur(colour, window), 1).astype(np.float32))
        odd = there[i] & (np.abs(logs[i] - usual).max(axis=2) > THIN)
        for j in range(len(views)):
            if j != i and odd.any():
                odd &= ~_near(logs[i], logs[j], there[j], RIM)
        wide = cv2.dilate(odd.astype(np.uint8), np.ones((2 * RIM + 1,) * 2, np.uint8)) > 0
        found.append(_on_texels(wide, side, view.seen.shape))
    return found


def _on_texels(squares: np.ndarray, side: int, shape: tuple[int, ...]) -> np.ndarray:
    """Squares (r, c) of `side` texels on the texels (h, w) of a raster."""
    return squares.repeat(side, axis=0).repeat(side, axis=1)[: shape[0], : shape[1]]


def _near(one: np.ndarray, other: np.ndarray, there: np.ndarray, reach: int = 1) -> np.ndarray:
    """Squares (r, c) of which another view shows the colour there or so many beside: a pose may be off by that."""
    found = np.zeros(there.shape, bool)
    rows, columns = there.shape
    padded = np.pad(other, ((reach, reach), (reach, reach), (0, 0)))
    known = np.pad(there, reach)
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            at = (slice(down, down + rows), slice(right, right + columns))
            found |= known[at] & (np.abs(one - padded[at]).max(axis=2) <= APART)
    return found


def _logs(view: View, side: int) -> np.ndarray:
    """Logarithms of the mean colour of the clear texels of squares: (r, c, 3)."""
    clear = view.clear
    share = _means(clear.astype(np.float32), side)
    total = _means(view.rgb * clear[..., None].astype(np.float32), side)
    return np.log(np.maximum(total / np.maximum(share, 1e-6)[..., None], 1.0))


def _means(array: np.ndarray, side: int) -> np.ndarray:
    """Means over squares of `side` texels of an array (h, w) or (h, w, 3); beyond the border lies 0."""
    import cv2

    rows, columns = (-(-n // side) for n in array.shape[:2])
    padding = (0, rows * side - array.shape[0], 0, columns * side - array.shape[1])
    whole = cv2.copyMakeBorder(array.astype(np.float32), *padding, cv2.BORDER_CONSTANT, value=(0, 0, 0))
    return cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)


def _view(scene: Scene, chart: int, camera: Camera) -> View:
    """A chart as one camera shows it, in the common exposure, from NEAR_M to GROUND_REACH_M."""
    size = (int(scene.placement.height[chart]), int(scene.placement.width[chart]))
    view = rectify_view(scene, chart, camera.image, camera.pose, size, camera.hidden)
    away = _away(scene, chart, camera.pose)
    seen = view.seen & (away >= NEAR_M) & (away <= GROUND_REACH_M)
    rgb = np.clip(view.rgb * camera.factor.astype(np.float32) + 0.5, 0, 255).astype(np.uint8)
    occluded = None if view.occluded is None else view.occluded & seen
    return View(rgb, seen, view.quality * seen, occluded)


def _away(scene: Scene, chart: int, pose: Pose) -> np.ndarray:
    """How far each texel of a chart is from the foot of a camera, (h, w) float32 metres."""
    charts, step = scene.charts, 1 / float(scene.placement.texels_per_metre[chart])
    place = position(pose)
    x = (np.arange(int(scene.placement.width[chart]), dtype=np.float32) + 0.5) * step
    y = (np.arange(int(scene.placement.height[chart]), dtype=np.float32) + 0.5) * step
    corner = (charts.origin[chart] - place)[:2]
    across, down = charts.axis_u[chart][:2], charts.axis_v[chart][:2]
    east = corner[0] + across[0] * x[None] + down[0] * y[:, None]
    north = corner[1] + across[1] * x[None] + down[1] * y[:, None]
    return np.hypot(east, north).astype(np.float32)


def _usual(camera: Camera) -> tuple[np.ndarray, np.ndarray] | None:
    """In the common exposure."""
    return None if camera.usual is None else (camera.usual[0] + np.log(camera.factor), camera.usual[1])


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
