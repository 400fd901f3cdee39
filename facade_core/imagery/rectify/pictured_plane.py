"""Detection of pictures that show another plane than their wall's: that of a building which the model lacks.

Two independent cues. Level lines of any upright plane determine the plane's direction, once the camera's place is known
(`estimate_pictured_turn`). Two cameras determine its depth: their pictures agree on the plane on which they are
rectified only if they show it (`estimate_pictured_depth`, a plane sweep). Each compares the wall's own plane with all
others instead of asking how a facade should look.

References
----------
Collins (1996), A space-sweep approach to true multi-image matching.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_position
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.line_segments import detect_line_segments
from facade_core.imagery.rectify.settings import PLANES


class PicturedTurn(NamedTuple):
    """Direction of the plane that a picture shows.

    Attributes
    ----------
    turn_deg : angle from the wall's plane, positive where the right end is farther away.
    own_support : metres of level lines that fit the wall's plane.
    other_support : metres of those that fit the best other plane, of `turn_deg`.
    other_lines : number of the latter.
    """

    turn_deg: float
    own_support: float
    other_support: float
    other_lines: int

    @property
    def is_other(self) -> bool:
        """Report whether the picture shows a plane of another direction."""
        is_supported = self.other_support >= max(PLANES.min_support_m, PLANES.min_support_ratio * self.own_support)
        return is_supported and self.other_lines >= PLANES.min_support_lines


class CameraFrame(NamedTuple):
    """Camera in the frame of a wall: metres right and down of the wall's corner, and metres before it."""

    right: float
    down: float
    before: float


def camera_in_chart_frame(scene: Scene, chart: int, pose: Pose) -> CameraFrame:
    """Return the camera of a pose in the frame of a chart."""
    charts = scene.charts
    offset = camera_position(pose) - charts.origin[chart]
    axes = (charts.axis_u[chart], charts.axis_v[chart], charts.normals()[chart])
    return CameraFrame(*(float((offset * axis).sum()) for axis in axes))


def estimate_pictured_turn(view: ChartView, camera: CameraFrame, texels_per_metre: float) -> PicturedTurn:
    """Estimate the direction of the upright plane that a rectified wall shows, by its level lines.

    The plane through the camera and a line on the picture meets the horizon in one direction: that of the line, if it
    is level. Lines of the wall agree on its own direction; those of another plane agree on another one.

    Parameters
    ----------
    view : the rectified wall; what the parser takes for occluders counts too, as it may be the other building.
    camera : the camera in the wall's frame.
    texels_per_metre : density of the view.
    """
    ends = detect_line_segments(
        view.rgb, view.seen, max(PLANES.min_line_pixels, PLANES.line_length_m[0] * texels_per_metre)
    )
    ends = ends / texels_per_metre
    along = ends[:, 1] - ends[:, 0]
    length = np.hypot(*along.T)
    slope = np.arctan2(along[:, 1], along[:, 0])
    is_slanted = np.abs(np.cos(slope)) > np.sin(np.radians(PLANES.upright_deg))
    ends, length, slope = ends[is_slanted], length[is_slanted], slope[is_slanted]
    error = np.hypot(
        np.radians(PLANES.min_slope_error_deg), PLANES.end_error_pixels / texels_per_metre / np.maximum(length, 1e-9)
    )
    middle = ends.mean(axis=1)
    turn, low, high = (_horizontal_turn(middle, slope + by, camera) for by in (0.0, -error, error))
    spread = np.maximum(*(np.abs(_fold_angle(other - turn)) for other in (low, high)))
    is_certain = spread <= PLANES.max_turn_error_deg
    turn, spread, weight = turn[is_certain], spread[is_certain], np.minimum(length[is_certain], PLANES.line_length_m[1])
    tried = np.arange(-90.0, 90.0)
    width = np.maximum(spread, 1.0)[:, None]
    fit = np.exp(-((_fold_angle(turn[:, None] - tried) / width) ** 2) / 2)
    votes = (weight[:, None] * fit).sum(axis=0)
    own = float(votes[np.abs(tried) <= PLANES.own_turn_deg].max())
    votes[np.abs(tried) < PLANES.other_turn_deg] = 0.0
    best = int(votes.argmax())
    return PicturedTurn(float(tried[best]), own, float(votes[best]), int((fit[:, best] > 0.5).sum()))


def _horizontal_turn(middle: Float64Array, slope: Float64Array, camera: CameraFrame) -> Float64Array:
    """Compute the direction (k,) of level lines that appear at places (k, 2) with slopes (k,), degrees from the wall."""
    ray = np.column_stack(
        [middle[:, 0] - camera.right, middle[:, 1] - camera.down, np.full(len(middle), camera.before)]
    )
    step = np.column_stack([np.cos(slope), np.sin(slope), np.zeros(len(slope))])
    normal = np.cross(ray, step)
    return _fold_angle(np.degrees(np.arctan2(-normal[:, 0], normal[:, 2])))


def _fold_angle(degrees: Float64Array) -> Float64Array:
    """Fold angles of lines into -90 to 90 degrees."""
    folded: Float64Array = (degrees + 90.0) % 180.0 - 90.0
    return folded


class PicturedDepth(NamedTuple):
    """Depth of the plane that two pictures show.

    Attributes
    ----------
    behind_m : metres from the wall's plane to the other plane on which they agree best, negative before it.
    own_correlation : agreement on the wall's plane, -1 to 1.
    other_correlation : agreement on the other plane.
    """

    behind_m: float
    own_correlation: float
    other_correlation: float

    @property
    def is_other(self) -> bool:
        """Report whether both pictures show a plane of another depth."""
        gain = self.other_correlation - max(self.own_correlation, 0.0)
        is_found = self.other_correlation >= PLANES.min_depth_correlation and gain >= PLANES.min_correlation_gain
        return is_found and not self.is_own

    @property
    def is_own(self) -> bool:
        """Report whether both pictures show the wall's plane."""
        return self.own_correlation >= PLANES.own_correlation


def estimate_pictured_depth(
    views: tuple[ChartView, ChartView], cameras: tuple[CameraFrame, CameraFrame], texels_per_metre: float
) -> PicturedDepth | None:
    """Estimate the depth of the plane that two rectified pictures of a wall show, by a sweep over parallel planes.

    A plane at another depth is, in a picture that is rectified on the wall, scaled about the camera's foot point on
    the wall. Gradient magnitudes are correlated, which depend less on the exposure than colours.

    Parameters
    ----------
    views : both views, of equal size; occluders do not count.
    cameras : their cameras in the wall's frame.
    texels_per_metre : density of the views.

    Returns
    -------
    The depth; None if the cameras are too close to each other or show too little in common.
    """
    baseline = float(np.hypot(cameras[0].right - cameras[1].right, cameras[0].down - cameras[1].down))
    if baseline < PLANES.min_baseline_m or min(camera.before for camera in cameras) <= 0:
        return None
    near = min(camera.before for camera in cameras)
    scales = np.arange(1 / PLANES.depth_shares[1], 1 / PLANES.depth_shares[0], PLANES.depth_step_m / baseline)
    reduced = [_reduce_gradient(view, texels_per_metre) for view in views]
    own, other, behind = -1.0, -1.0, 0.0
    for scale in (1.0, *scales.tolist()):
        depth = near / scale - near
        score = _correlate_on_plane(reduced, cameras, depth)
        displacement = baseline * abs(1 - scale)
        if score is None:
            continue
        if displacement <= PLANES.own_displacement_m:
            own = max(own, score)
        elif displacement >= PLANES.other_displacement_m and score > other:
            other, behind = score, depth
    return None if own == -1.0 else PicturedDepth(behind, own, other)


def explain_other_planes(
    views: Sequence[ChartView], cameras: Sequence[CameraFrame], texels_per_metre: float
) -> list[str]:
    """Explain for each picture of a wall why it shows another plane; "" where nothing says so.

    Two pictures that agree on another depth both show something else, unless a third agrees with one of them on the
    wall.

    Parameters
    ----------
    views : rectified views of one wall, of equal size.
    cameras : the camera of each view in the wall's frame.
    texels_per_metre : density of the views.
    """
    reasons = []
    for view, camera in zip(views, cameras, strict=True):
        turn = estimate_pictured_turn(view, camera, texels_per_metre)
        reasons.append(f"turned by {abs(turn.turn_deg):.0f} degrees" if turn.is_other else "")
    confirmed, contradicted = set[int](), dict[int, float]()
    for i, j in combinations([k for k, reason in enumerate(reasons) if not reason], 2):
        depth = estimate_pictured_depth((views[i], views[j]), (cameras[i], cameras[j]), texels_per_metre)
        if depth is not None and depth.is_own:
            confirmed |= {i, j}
        elif depth is not None and depth.is_other:
            contradicted |= {i: depth.behind_m, j: depth.behind_m}
    for k in contradicted.keys() - confirmed:
        side = "behind" if contradicted[k] > 0 else "before"
        reasons[k] = f"{abs(contradicted[k]):.0f} m {side} it, as two pictures agree"
    return reasons


class _ReducedGradient(NamedTuple):
    """Gradient magnitude (h, w) of a view in cells, the weight (h, w) of each cell, and cells per metre."""

    slope: Float32Array
    weight: Float32Array
    density: float


def _reduce_gradient(view: ChartView, texels_per_metre: float) -> _ReducedGradient:
    import cv2

    share = min(1.0, PLANES.cells_per_metre / texels_per_metre)
    size = tuple(max(4, round(side * share)) for side in view.seen.shape[::-1])
    density = texels_per_metre * size[1] / view.seen.shape[0]
    grey = cv2.resize(cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
    clear = (cv2.resize(view.clear.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.99).astype(np.uint8)
    weight = cv2.erode(clear, np.ones((3, 3), np.uint8), borderValue=0).astype(np.float32)
    tone = np.log(grey.astype(np.float32) + 16)
    slope = np.hypot(cv2.Sobel(tone, cv2.CV_32F, 1, 0), cv2.Sobel(tone, cv2.CV_32F, 0, 1)) * weight
    sigma = PLANES.gradient_blur_m * density
    blurred = cv2.GaussianBlur(slope, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    return _ReducedGradient(np.asarray(blurred, np.float32), weight, density)


def _correlate_on_plane(
    reduced: list[_ReducedGradient], cameras: tuple[CameraFrame, CameraFrame], depth: float
) -> float | None:
    """Correlate two pictures on a plane behind the wall, -1 to 1; None if they share too little of it."""
    import cv2

    slopes, weights = [], []
    for (slope, weight, density), camera in zip(reduced, cameras, strict=True):
        scale = camera.before / (camera.before + depth)
        map_back = np.array(
            [
                [scale, 0, (1 - scale) * (camera.right * density - 0.5)],
                [0, scale, (1 - scale) * (camera.down * density - 0.5)],
            ]
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        slopes.append(cv2.warpAffine(slope, map_back, slope.shape[::-1], flags=flags))
        weights.append(cv2.warpAffine(weight, map_back, slope.shape[::-1], flags=flags))
    both = (weights[0] > 0.99) & (weights[1] > 0.99)
    if both.mean() < PLANES.min_common_share:
        return None
    one, two = (slope[both] for slope in slopes)
    if one.std() < 1e-6 or two.std() < 1e-6:
        return None
    one, two = one - one.mean(), two - two.mean()
    return float((one * two).sum() / np.sqrt((one**2).sum() * (two**2).sum()))
