"""Camera and axes of a facade from line segments, by jointly estimated vanishing points.

Lengths are shares of the photo's half diagonal, from its centre, x right and y down; the camera looks along z. A
facade's vertical and horizontal lines have two vanishing points, which a focal length turns into two orthogonal
directions. RANSAC over pairs of segments finds the vertical one. Given it and a focal length, one angle remains, which
is searched in steps. Least squares over the agreeing segments then refine rotation, focal length and distortion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import AnyArray, Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.ties import first_maximum

# 35 mm equivalent focal lengths that are tried when it is unknown,
TRIED_FOCALS_MM = (22.0, 28.0, 36.0, 48.0)
# its expected value,
EXPECTED_FOCAL_MM = 31.0
# and the standard error of its logarithm: most photos of buildings are within this factor.
FOCAL_LOG_SIGMA = 0.25
# The same for a stated focal length.
GIVEN_FOCAL_LOG_SIGMA = 0.02
# Half diagonal of that film in millimetres.
HALF_DIAGONAL_MM = 21.63
# Standard deviation of radial distortion: shift at the corner over the half diagonal.
DISTORTION_SIGMA = 0.015
# Largest angle in degrees between a facade's edges and the photo's vertical.
MAX_VERTICAL_DEG = 42.0
# Largest rotation of a facade in degrees: yaw,
MAX_YAW_DEG = 66.0
# pitch
MAX_PITCH_DEG = 42.0
# and roll.
MAX_ROLL_DEG = 22.0
# Degrees by which a segment may miss its vanishing point in the search,
SEARCH_TOLERANCE_DEG = 2.5
# and in the rounds of least squares.
ROUND_TOLERANCES_DEG = (2.5, 1.6, 1.2)
# Error of a segment's ends in pixels,
END_SIGMA_PX = 0.7
# and of its direction in radians at any length: walls are not perfectly straight.
DIRECTION_SIGMA = 0.006
# Segments that count as independent: errors of a crooked building are correlated.
MAX_INDEPENDENT = 150.0
# Sampled pairs of segments.
RANSAC_PAIRS = 1000
# Vertical vanishing points that are followed up.
MAX_CANDIDATES = 4


@dataclass(frozen=True, slots=True, eq=False)
class FacadeCamera:
    """Camera relative to a facade.

    Attributes
    ----------
    rotation : (3, 3) columns are the facade's right, its down and away from the viewer, in camera coordinates.
    focal : focal length in half diagonals.
    distortion : undistorted = point / (1 + distortion r^2).
    family : (n,) int8, 0 for segments along the facade's right, 1 along its down, -1 for others.
    """

    rotation: Float64Array
    focal: float
    distortion: float
    family: AnyArray


def find_facade_camera(segments: Float64Array, pixel: float, focal: float | None) -> FacadeCamera | None:
    """Find the camera with which most of the segments' length agrees.

    Parameters
    ----------
    segments : (n, 2, 2) float64 in half diagonals.
    pixel : size of a pixel in half diagonals.
    focal : focal length in half diagonals, None if unknown.

    Returns
    -------
    The camera; None if no two vanishing points are found.
    """
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    if focal is not None:
        return _find_camera(segments, lengths, pixel, focal, (float(np.log(focal)), GIVEN_FOCAL_LOG_SIGMA))
    expected = float(np.log(EXPECTED_FOCAL_MM / HALF_DIAGONAL_MM))
    found = _find_camera(segments, lengths, pixel, None, (expected, FOCAL_LOG_SIGMA))
    # A facade seen from its front determines no focal length, and the centre of a photo that was cropped misleads about it.
    return found or _find_camera(segments, lengths, pixel, None, (expected, GIVEN_FOCAL_LOG_SIGMA))


def _find_camera(
    segments: Float64Array, lengths: Float64Array, pixel: float, focal: float | None, expected: tuple[float, float]
) -> FacadeCamera | None:
    """Find the camera with which most of the segments' length (n,) agrees; None without one.

    expected : logarithm of the focal length and its standard error.
    """
    best, best_score = None, 0.0
    for start in _search_cameras(segments, lengths, focal):
        camera = _refine_camera(segments, lengths, pixel, start, expected, ROUND_TOLERANCES_DEG[0])
        if camera is None or not is_plausible_camera_rotation(camera.rotation):
            continue
        straight = undistort(segments, camera.distortion)
        yaw = np.radians(camera_angles(camera.rotation)[0])
        score = _agreement_scores(
            straight, lengths, camera.rotation[:, 1], camera.focal, np.array([yaw]), np.radians(ROUND_TOLERANCES_DEG[0])
        )[0]
        if score > best_score:
            best, best_score = camera, score
    for tolerance in ROUND_TOLERANCES_DEG[1:]:
        best = best and _refine_camera(segments, lengths, pixel, best, expected, tolerance)
    if best is None or not is_plausible_camera_rotation(best.rotation):
        return None
    return replace(best, family=_assign_families(segments, best, ROUND_TOLERANCES_DEG[-1]))


def is_plausible_camera_rotation(rotation: Float64Array) -> bool:
    """Return True if yaw, pitch and roll of a rotation (3, 3) are plausible before a facade."""
    return all(
        abs(turn) <= most
        for turn, most in zip(camera_angles(rotation), (MAX_YAW_DEG, MAX_PITCH_DEG, MAX_ROLL_DEG), strict=True)
    )


def undistort(points: Float64Array, distortion: float) -> Float64Array:
    """Remove radial distortion from points (..., 2)."""
    undistorted: Float64Array = points / (1 + distortion * (points**2).sum(axis=-1, keepdims=True))
    return undistorted


def distort(points: Float64Array, distortion: float) -> Float64Array:
    """Apply radial distortion to points (..., 2), the inverse of `undistort`."""
    square = (points**2).sum(axis=-1, keepdims=True)
    distorted: Float64Array = points * 2 / (1 + np.sqrt(np.maximum(1 - 4 * distortion * square, 0.0)))
    return distorted


def camera_angles(rotation: Float64Array) -> tuple[float, float, float]:
    """Compute yaw, pitch (of the camera, up) and roll in degrees from the rotation of a FacadeCamera."""
    down = rotation[:, 1]
    pitch = np.arcsin(np.clip(-down[2], -1, 1))
    roll = np.arctan2(-down[0], down[1])
    yaw = np.arctan2(*multiply_matrices(_horizontal_directions(down, np.radians([90.0, 0.0])), rotation[:, 0]))
    return float(np.degrees(yaw)), float(np.degrees(pitch)), float(np.degrees(roll))


def _search_cameras(segments: Float64Array, lengths: Float64Array, focal: float | None) -> list[FacadeCamera]:
    """Cameras to start from, without assigned segments: the best for each candidate of the vertical."""
    step = segments[:, 1] - segments[:, 0]
    is_steep = np.abs(step[:, 0]) < np.tan(np.radians(MAX_VERTICAL_DEG)) * np.abs(step[:, 1])
    if is_steep.sum() < 3 or (~is_steep).sum() < 3:
        return []
    cameras = []
    yaws = np.radians(np.arange(-MAX_YAW_DEG, MAX_YAW_DEG + 0.5, 1.0))
    for point in _vertical_candidates(segments[is_steep], lengths[is_steep]):
        best, best_score = None, 0.0
        for length in [mm / HALF_DIAGONAL_MM for mm in TRIED_FOCALS_MM] if focal is None else [focal]:
            down = point / np.array([length, length, 1.0])
            down /= np.linalg.norm(down) * (np.sign(down[1]) or 1.0)
            score = _agreement_scores(segments, lengths, down, length, yaws, np.radians(SEARCH_TOLERANCE_DEG))
            k = first_maximum(score)
            if score[k] > best_score:
                right = _horizontal_directions(down, yaws[k : k + 1])[0]
                rotation = np.column_stack([right, down, np.cross(right, down)])
                best, best_score = FacadeCamera(rotation, length, 0.0, np.empty(0, np.int8)), score[k]
        if best is not None and is_plausible_camera_rotation(best.rotation):
            cameras.append(best)
    return cameras


def _agreement_scores(
    segments: Float64Array,
    lengths: Float64Array,
    down: Float64Array,
    focal: float,
    yaws: Float64Array,
    tolerance: float,
) -> Float64Array:
    """Length of segments (n, 2, 2) that agrees with a facade's down (3,) or with its right at each yaw (k,): (k,).

    Segments at eye level agree with every yaw. Therefore a segment counts by its agreement above the average over all
    yaws.
    """
    scale = np.array([focal, focal, 1.0])
    vertical = _agreement(_angles(segments, (down * scale)[None]), tolerance)
    all_yaws = np.radians(np.arange(-MAX_YAW_DEG, MAX_YAW_DEG + 0.5, 2.0))
    mean_level = _agreement(_angles(segments, _horizontal_directions(down, all_yaws) * scale), tolerance).mean(
        axis=1, keepdims=True
    )
    level = _agreement(_angles(segments, _horizontal_directions(down, yaws) * scale), tolerance) - mean_level
    return multiply_matrices(lengths, np.maximum(vertical, level))


def level_agreement(
    straight: Float64Array, view: FacadeCamera, yaws: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Compute the agreement of lines with the level lines of facades of other yaws, above its average over the yaws.

    Parameters
    ----------
    straight : (n, 2, 2) undistorted segments.
    view : camera, which gives the vertical.
    yaws : (k,) radians.

    Returns
    -------
    Directions (k, 3) of the facades' level lines, and agreement (n, k), 0 to 1.
    """
    directions = _horizontal_directions(view.rotation[:, 1], yaws)
    vanishing = directions * np.array([view.focal, view.focal, 1.0])
    agreement = _agreement(_angles(straight, vanishing), np.radians(SEARCH_TOLERANCE_DEG))
    return directions, np.maximum(agreement - agreement.mean(axis=1, keepdims=True), 0.0)


def _horizontal_directions(down: Float64Array, yaws: Float64Array) -> Float64Array:
    """Directions (k, 3) orthogonal to down, rotated about it by yaws (k,) from the camera's right."""
    level = np.array([1.0, 0.0, 0.0]) - down[0] * down
    level /= np.linalg.norm(level)
    directions: Float64Array = np.cos(yaws)[:, None] * level + np.sin(yaws)[:, None] * np.cross(level, down)
    return directions


def _vertical_candidates(segments: Float64Array, lengths: Float64Array) -> Float64Array:
    """Vanishing points (k, 3) on which steep segments agree, best first."""
    rng = np.random.default_rng(0)
    pairs = rng.choice(len(segments), (RANSAC_PAIRS, 2), p=lengths / lengths.sum())
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    ends = np.concatenate([segments, np.ones((len(segments), 2, 1))], axis=2)
    lines = np.cross(ends[:, 0], ends[:, 1])
    lines /= np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
    points: Float64Array = np.cross(lines[pairs[:, 0]], lines[pairs[:, 1]])
    points = points[np.linalg.norm(points, axis=1) > 1e-9]
    points /= np.linalg.norm(points, axis=1, keepdims=True) * np.where(points[:, 1:2] < 0, -1.0, 1.0)
    # only points far above or below, as the limits of the pitch require
    nearest = TRIED_FOCALS_MM[0] / HALF_DIAGONAL_MM / np.tan(np.radians(MAX_PITCH_DEG))
    points = points[np.abs(points[:, 1]) > nearest * np.abs(points[:, 2])]
    if len(points) == 0:
        return points
    score = (lengths[:, None] * _agreement(_angles(segments, points), np.radians(SEARCH_TOLERANCE_DEG))).sum(axis=0)
    chosen: list[Float64Array] = []
    for k in np.argsort(-score, kind="stable"):
        if all(abs((points[k] * other).sum()) < np.cos(np.radians(2.0)) for other in chosen):
            chosen.append(points[k])
        if len(chosen) == MAX_CANDIDATES:
            break
    return np.array(chosen)


def _agreement(miss: Float64Array, tolerance: float) -> Float64Array:
    """Agreement: 1 for no miss, 0 from the tolerance on."""
    return np.maximum(0.0, 1.0 - (miss / tolerance) ** 2)


def _angles(segments: Float64Array, points: Float64Array) -> Float64Array:
    """Return the signed angles (n, k) in radians from segments (n, 2, 2) to rays through points.

    Rays start at the middles of the segments; points are (k, 3) or (n, k, 3).
    """
    step = segments[:, 1] - segments[:, 0]
    step = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    middle = segments.mean(axis=1)
    x, y, w = points[..., 0], points[..., 1], points[..., 2]
    to_x, to_y = x - middle[:, :1] * w, y - middle[:, 1:] * w
    sine = step[:, :1] * to_y - step[:, 1:] * to_x
    angles: Float64Array = np.arcsin(np.clip(sine / np.maximum(np.sqrt(to_x * to_x + to_y * to_y), 1e-12), -1.0, 1.0))
    return angles


def _vanishing_points(rotation: Float64Array, focal: float) -> Float64Array:
    """Homogeneous vanishing points (2, 3) of the facade's right and down."""
    points: Float64Array = rotation[:, :2].T * np.array([focal, focal, 1.0])
    return points


def _assign_families(segments: Float64Array, camera: FacadeCamera, tolerance: float) -> AnyArray:
    """Family (n,) int8 of each segment, -1 for misses of both vanishing points by more than tolerance degrees."""
    straight = undistort(segments, camera.distortion)
    angles = np.abs(_angles(straight, _vanishing_points(camera.rotation, camera.focal)))
    return np.where(angles.min(axis=1) < np.radians(tolerance), angles.argmin(axis=1), -1).astype(np.int8)


def _refine_camera(
    segments: Float64Array,
    lengths: Float64Array,
    pixel: float,
    camera: FacadeCamera,
    expected: tuple[float, float],
    tolerance: float,
) -> FacadeCamera | None:
    """Camera of least squared misses of the segments within tolerance degrees; None if these are too few.

    expected : logarithm of the focal length and its standard error.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    family = _assign_families(segments, camera, tolerance)
    if min((family == 0).sum(), (family == 1).sum()) < 3:
        return None
    used = family >= 0
    used_segments, used_family = segments[used], family[used]
    sigma = np.hypot(END_SIGMA_PX * pixel * 2 / lengths[used], DIRECTION_SIGMA)
    weight = min(1.0, np.sqrt(MAX_INDEPENDENT / len(used_segments))) / sigma

    def misses(state: Float64Array) -> Float64Array:
        rotation = Rotation.from_rotvec(state[:3]).as_matrix() @ camera.rotation
        vanishing = _vanishing_points(rotation, np.exp(state[3]))[used_family]
        angles = _angles(undistort(used_segments, state[4]), vanishing[:, None])[:, 0] * weight
        # Cauchy error: misses beyond about two sigma count less and less.
        robust = np.sign(angles) * np.sqrt(4 * np.log1p(angles**2 / 4))
        return np.append(robust, [(state[3] - expected[0]) / expected[1], state[4] / DISTORTION_SIGMA])

    start = np.array([0.0, 0.0, 0.0, np.log(camera.focal), camera.distortion])
    solution = least_squares(misses, start, x_scale=[0.01, 0.01, 0.01, 0.05, 0.005], ftol=1e-5, max_nfev=15).x
    rotation = Rotation.from_rotvec(solution[:3]).as_matrix() @ camera.rotation
    return FacadeCamera(rotation, float(np.exp(solution[3])), float(solution[4]), family)
