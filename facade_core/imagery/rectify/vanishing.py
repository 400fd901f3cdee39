"""The two axes of a facade and the camera that sees it, from line segments: vanishing points found jointly.

Lengths are shares of the photo's half diagonal, from its centre, x right and y down; the camera looks along z. A facade's
vertical and horizontal lines meet the picture plane in two vanishing points, which a focal length turns into two directions
at a right angle. The vertical one is sought by RANSAC over pairs of segments; given it and a focal length, one angle is left,
which is searched in steps. Least squares over the segments that agree then settle rotation, focal length and distortion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

# Focal lengths (35 mm equivalents) tried when it is unknown, and what is then expected: most cameras of houses lie within
# a factor exp(FOCAL_SPREAD). Half the diagonal of that film is HALF_FILM mm.
FOCALS_MM = (22.0, 28.0, 36.0, 48.0)
FOCAL_MM = 31.0
FOCAL_SPREAD = 0.25
GIVEN_SPREAD = 0.02
HALF_FILM = 21.63
# Radial distortion to expect: the shift at the corner as a share of the half diagonal.
DISTORTION_SPREAD = 0.015
# Degrees: how far from the photo's vertical a facade's edges may run, and what the facade may be turned by.
STEEPEST = 42.0
MOST_YAW, MOST_PITCH, MOST_ROLL = 66.0, 42.0, 22.0
# Degrees by which a segment may miss its vanishing point: in the search, and in the rounds of least squares.
SEARCH = 2.5
ROUNDS = (2.5, 1.6, 1.2)
# What a segment's direction is known to: pixels at its ends, and radians however long it is (walls are not quite straight).
END_PIXELS = 0.7
CROOKED = 0.006
# Segments err together (a crooked house): no more than this many tell independently.
INDEPENDENT = 150.0
PAIRS = 1000
CANDIDATES = 4


@dataclass(frozen=True, slots=True, eq=False)
class FacadeCamera:
    """How a camera sees a facade.

    rotation (3, 3): its columns are the facade's right, its down and away from the viewer, in camera coordinates; focal in half
    diagonals; distortion: undistorted = point / (1 + distortion r^2); family (n,) int8, 0 for segments along the facade's
    right, 1 along its down, -1 others.
    """

    rotation: np.ndarray
    focal: float
    distortion: float
    family: np.ndarray


def find_facade_camera(segments: np.ndarray, pixel: float, focal: float | None) -> FacadeCamera | None:
    """The view that most of the segments' length agrees with; None where no two vanishing points are found.

    segments (n, 2, 2) float64 and focal in half diagonals, pixel is the size of one; focal None: unknown.
    """
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    expected = (np.log(FOCAL_MM / HALF_FILM), FOCAL_SPREAD) if focal is None else (np.log(focal), GIVEN_SPREAD)
    best, best_score = None, 0.0
    for start in _search(segments, lengths, focal):
        view = _settle(segments, lengths, pixel, start, expected, ROUNDS[0])
        if view is None or not is_upright(view.rotation):
            continue
        straight = undistort(segments, view.distortion)
        yaw = np.radians(camera_angles(view.rotation)[0])
        score = _scores(straight, lengths, view.rotation[:, 1], view.focal, np.array([yaw]), np.radians(ROUNDS[0]))[0]
        if score > best_score:
            best, best_score = view, score
    for tolerance in ROUNDS[1:]:
        best = best and _settle(segments, lengths, pixel, best, expected, tolerance)
    if best is None or not is_upright(best.rotation):
        return None
    return replace(best, family=_families(segments, best, ROUNDS[-1]))


def is_upright(rotation: np.ndarray) -> bool:
    """Whether a rotation is one that a camera before a facade may have."""
    return all(abs(turn) <= most for turn, most in zip(camera_angles(rotation), (MOST_YAW, MOST_PITCH, MOST_ROLL), strict=True))


def undistort(points: np.ndarray, distortion: float) -> np.ndarray:
    """Points (..., 2) as a lens without radial distortion would show them."""
    return points / (1 + distortion * (points**2).sum(axis=-1, keepdims=True))


def distort(points: np.ndarray, distortion: float) -> np.ndarray:
    """The inverse of undistort."""
    square = (points**2).sum(axis=-1, keepdims=True)
    return points * 2 / (1 + np.sqrt(np.maximum(1 - 4 * distortion * square, 0.0)))


def camera_angles(rotation: np.ndarray) -> tuple[float, float, float]:
    """Yaw, pitch (of the camera, up) and roll in degrees of a View's rotation: what the camera is turned by."""
    down = rotation[:, 1]
    pitch = np.arcsin(np.clip(-down[2], -1, 1))
    roll = np.arctan2(-down[0], down[1])
    yaw = np.arctan2(*(rotation[:, 0] @ _rights(down, np.radians([90.0, 0.0])).T))
    return float(np.degrees(yaw)), float(np.degrees(pitch)), float(np.degrees(roll))


def _search(segments: np.ndarray, lengths: np.ndarray, focal: float | None) -> list[FacadeCamera]:
    """Views to start from, no segments assigned: the best for each vertical that comes into question."""
    step = segments[:, 1] - segments[:, 0]
    steep = np.abs(step[:, 0]) < np.tan(np.radians(STEEPEST)) * np.abs(step[:, 1])
    if steep.sum() < 3 or (~steep).sum() < 3:
        return []
    found = []
    yaws = np.radians(np.arange(-MOST_YAW, MOST_YAW + 0.5, 1.0))
    for point in _vertical_candidates(segments[steep], lengths[steep]):
        best, best_score = None, 0.0
        for length in [mm / HALF_FILM for mm in FOCALS_MM] if focal is None else [focal]:
            down = point / np.array([length, length, 1.0])
            down /= np.linalg.norm(down) * (np.sign(down[1]) or 1.0)
            score = _scores(segments, lengths, down, length, yaws, np.radians(SEARCH))
            k = int(np.argmax(score))
            if score[k] > best_score:
                right = _rights(down, yaws[k : k + 1])[0]
                rotation = np.column_stack([right, down, np.cross(right, down)])
                best, best_score = FacadeCamera(rotation, length, 0.0, np.empty(0, np.int8)), score[k]
        if best is not None and is_upright(best.rotation):
            found.append(best)
    return found


def _scores(
    segments: np.ndarray, lengths: np.ndarray, down: np.ndarray, focal: float, yaws: np.ndarray, tolerance: float
) -> np.ndarray:
    """Length of segments (n, 2, 2) that agrees with a facade's down (3,) or its right at each yaw (k,) around it: (k,).

    Segments level with the eye agree with every yaw, and so speak for none: of each counts by how much it agrees more with
    one yaw than it does on average.
    """
    scale = np.array([focal, focal, 1.0])
    vertical = _agreement(_angles(segments, (down * scale)[None]), tolerance)
    every = np.radians(np.arange(-MOST_YAW, MOST_YAW + 0.5, 2.0))
    usual = _agreement(_angles(segments, _rights(down, every) * scale), tolerance).mean(axis=1, keepdims=True)
    level = _agreement(_angles(segments, _rights(down, yaws) * scale), tolerance) - usual
    return lengths @ np.maximum(vertical, level)


def _rights(down: np.ndarray, yaws: np.ndarray) -> np.ndarray:
    """Directions (k, 3) at a right angle to down, turned by yaws (k,) about it from the camera's right."""
    level = np.array([1.0, 0.0, 0.0]) - down[0] * down
    level /= np.linalg.norm(level)
    return np.cos(yaws)[:, None] * level + np.sin(yaws)[:, None] * np.cross(level, down)


def _vertical_candidates(segments: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Vanishing points (k, 3) on which steep segments agree, the best first."""
    chance = np.random.default_rng(0)
    pairs = chance.choice(len(segments), (PAIRS, 2), p=lengths / lengths.sum())
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    ends = np.concatenate([segments, np.ones((len(segments), 2, 1))], axis=2)
    lines = np.cross(ends[:, 0], ends[:, 1])
    lines /= np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
    points = np.cross(lines[pairs[:, 0]], lines[pairs[:, 1]])
    points = points[np.linalg.norm(points, axis=1) > 1e-9]
    points /= np.linalg.norm(points, axis=1, keepdims=True) * np.where(points[:, 1:2] < 0, -1.0, 1.0)
    # Only points far above or below, which a camera within the limits can show.
    nearest = FOCALS_MM[0] / HALF_FILM / np.tan(np.radians(MOST_PITCH))
    points = points[np.abs(points[:, 1]) > nearest * np.abs(points[:, 2])]
    if len(points) == 0:
        return points
    score = (lengths[:, None] * _agreement(_angles(segments, points), np.radians(SEARCH))).sum(axis=0)
    chosen: list[np.ndarray] = []
    for k in np.argsort(-score, kind="stable"):
        if all(abs(points[k] @ other) < np.cos(np.radians(2.0)) for other in chosen):
            chosen.append(points[k])
        if len(chosen) == CANDIDATES:
            break
    return np.array(chosen)


def _agreement(miss: np.ndarray, tolerance: float) -> np.ndarray:
    """1 for no miss, falling to 0 at the tolerance."""
    return np.maximum(0.0, 1.0 - (miss / tolerance) ** 2)


def _angles(segments: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed angles (n, k) in radians from segments (n, 2, 2) to the rays from their middles to points (k, 3) or (n, k, 3)."""
    step = segments[:, 1] - segments[:, 0]
    step = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    middle = segments.mean(axis=1)
    x, y, w = points[..., 0], points[..., 1], points[..., 2]
    to_x, to_y = x - middle[:, :1] * w, y - middle[:, 1:] * w
    sine = step[:, :1] * to_y - step[:, 1:] * to_x
    return np.arcsin(np.clip(sine / np.maximum(np.sqrt(to_x * to_x + to_y * to_y), 1e-12), -1.0, 1.0))


def _vanishing(rotation: np.ndarray, focal: float) -> np.ndarray:
    """Vanishing points (2, 3), homogeneous, of the facade's right and down."""
    return rotation[:, :2].T * np.array([focal, focal, 1.0])


def _families(segments: np.ndarray, view: FacadeCamera, tolerance: float) -> np.ndarray:
    """The family (n,) int8 of each segment, among those that miss its vanishing point by less than tolerance degrees."""
    straight = undistort(segments, view.distortion)
    angles = np.abs(_angles(straight, _vanishing(view.rotation, view.focal)))
    return np.where(angles.min(axis=1) < np.radians(tolerance), angles.argmin(axis=1), -1).astype(np.int8)


def _settle(
    segments: np.ndarray,
    lengths: np.ndarray,
    pixel: float,
    view: FacadeCamera,
    expected: tuple[float, float],
    tolerance: float,
) -> FacadeCamera | None:
    """The view of least squared misses of the segments within tolerance degrees; None if they are hardly any.

    expected: the logarithm of the focal length and its standard deviation.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    family = _families(segments, view, tolerance)
    if min((family == 0).sum(), (family == 1).sum()) < 3:
        return None
    used = family >= 0
    own, which = segments[used], family[used]
    sigma = np.hypot(END_PIXELS * pixel * 2 / lengths[used], CROOKED)
    weight = min(1.0, np.sqrt(INDEPENDENT / len(own))) / sigma

    def misses(state: np.ndarray) -> np.ndarray:
        turned = Rotation.from_rotvec(state[:3]).as_matrix() @ view.rotation
        vanishing = _vanishing(turned, np.exp(state[3]))[which]
        angles = _angles(undistort(own, state[4]), vanishing[:, None])[:, 0] * weight
        # Misses beyond about two sigma count less and less (Cauchy), as do segments that only happen to agree.
        robust = np.sign(angles) * np.sqrt(4 * np.log1p(angles**2 / 4))
        return np.append(robust, [(state[3] - expected[0]) / expected[1], state[4] / DISTORTION_SPREAD])

    start = np.array([0.0, 0.0, 0.0, np.log(view.focal), view.distortion])
    found = least_squares(misses, start, x_scale=[0.01, 0.01, 0.01, 0.05, 0.005], ftol=1e-5, max_nfev=15).x
    rotation = Rotation.from_rotvec(found[:3]).as_matrix() @ view.rotation
    return FacadeCamera(rotation, float(np.exp(found[3])), float(found[4]), family)
