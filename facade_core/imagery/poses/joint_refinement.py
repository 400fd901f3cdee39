"""Panoramas that show the same walls, refined together, after each was refined alone (`refine_pose`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.bundle_adjustment import BundleAdjustment
from facade_core.imagery.poses.panorama_camera import camera_position, rotate_pose
from facade_core.imagery.poses.shared_walls import PatchMatches, WallAgreement, match_shared_walls
from facade_core.imagery.poses.wall_lines import WallLines, detect_wall_lines, line_misfit, median_slope

# Pictures are compared at most so wide, pixels of a full turn: a texel of 10 cm at 60 m.
MAX_TURN_PIXELS = 4096
# How far walls may lie off where poses have them, metres: first, and once poses agree.
WALL_M, AGAIN_M, ROUNDS = 2.6, 0.8, 3
# Expected errors of a pose that was refined alone: metres east, north and up, degrees of tilt and heading; at least, where
# outlines of buildings told its place, and where not.
TOLD, NOT_TOLD = np.array([0.03, 0.03, 0.03, 0.05, 0.05, 0.05]), np.array([0.5, 0.5, 1.5, 0.5, 0.5, 1.0])
# Of the six, which outlines tell; they count a turn clockwise from above, and equations against that.
PLACE, SENSE = np.array([0, 1, 2, 5]), np.array([1, 1, 1, -1])
# Together is not better where lines fit worse by this share, walls agree less by this much, patches that were left out lie
# apart farther by this much, metres, or a pose is moved on the level by more than the last.
WORSE_LINES, WORSE_WALLS, WORSE_M, MOST_M = 0.1, 0.02, 0.01, 1.2
# So many walls are left out one by one, of fewer a part of each.
SOME_WALLS = 4
# A pose is told in whole millimetres and thousandths of a degree: what changes less makes nobody due.
DIGITS = 3


@dataclass(frozen=True, slots=True, eq=False)
class PriorPose:
    """A pose that was refined alone; spread (4, 4) as of `RefinedPose`, None where outlines did not tell its place."""

    pose: Pose
    covariance: np.ndarray | None


@dataclass(frozen=True, slots=True)
class JointPose:
    """A pose refined with others, or the one refined alone with the reason why not, "" for none.

    surfaces: on how many walls and pieces of ground others agree; apart_before, apart: how far apart what both show of these
    lies, median, metres, by the poses refined alone and by these, NaN without; residual_degrees as of `RefinedPose`.
    """

    pose: Pose
    reason: str
    surfaces: int
    distance_before: float
    distance_after: float
    residual_degrees: float


def refine_jointly(
    scene: Scene, surfaces: Sequence[int], images: Iterable[np.ndarray], alone: Sequence[PriorPose]
) -> list[JointPose]:
    """The poses of a bundle of panoramas by what they show of the same walls and ground.

    surfaces: charts that more than one of them may show; images (H, W, 3) uint8 as of `rectify_view`, taken one at a time: a
    picture of WIDEST is kept of each. ROUNDS of `shared` and `BundleAdjustment`. A panorama that is not better together by evidence
    that was left out, by its lines or by how well all of a wall agrees, keeps the pose refined alone, and others do without it.
    """
    start = [one.pose for one in alone]
    lines, small = [], []
    for image, pose in zip(images, start, strict=True):
        lines.append(detect_wall_lines(scene, image, pose))
        small.append(downscale_panorama(image, pose))
    adjustment = BundleAdjustment(scene, start, lines, np.array([_expected(one) for one in alone]))
    before = match_shared_walls(scene, surfaces, small, start, WALL_M)
    why = [""] * len(start)
    while True:
        change, found, alike = _adjusted(scene, surfaces, small, start, adjustment, before, [not one for one in why])
        worse = _worse(adjustment, change, found, lines, before[1], alike)
        if not worse:
            break
        for number, reason in worse.items():
            why[number] = reason
    still = np.zeros_like(change)
    apart = [adjustment.match_distances(found, one) for one in (still, change)]
    told = []
    for number, one in enumerate(alone):
        own = (found.panorama == number).any(axis=1)
        was, now = (float(np.median(far[own])) if own.any() else float("nan") for far in apart)
        reason = why[number] or ("" if own.any() else "alone: nothing in sight agrees with what others show of it")
        pose, turn = (one.pose, np.eye(3)) if reason else (_changed(one.pose, change[number]), _turn(change[number]))
        tilt = median_slope(lines[number], turn) if len(lines[number]) else float("nan")
        told.append(JointPose(pose, reason, len(np.unique(found.chart[own])), was, now, tilt))
    return told


def downscale_panorama(image: np.ndarray, pose: Pose) -> np.ndarray:
    """A panorama (H, W, 3) uint8, the part pose.view of the full one, of WIDEST pixels a turn at most."""
    import cv2

    shrink = MAX_TURN_PIXELS * pose.view[2] / image.shape[1]
    if shrink >= 1:
        return image
    size = (max(1, round(image.shape[1] * shrink)), max(1, round(image.shape[0] * shrink)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def _expected(one: PriorPose) -> np.ndarray:
    """The covariance (6, 6) of a pose that was refined alone: place, metres, and turns about the axes, degrees."""
    if one.covariance is None:
        return np.diag(NOT_TOLD**2)
    expected = np.diag(TOLD**2)
    expected[np.ix_(PLACE, PLACE)] += one.covariance * np.outer(SENSE, SENSE)
    return expected


def _adjusted(
    scene: Scene,
    surfaces: Sequence[int],
    images: Sequence[np.ndarray],
    start: Sequence[Pose],
    adjustment: BundleAdjustment,
    before: tuple[PatchMatches, list[WallAgreement]],
    taken: Sequence[bool],
) -> tuple[np.ndarray, PatchMatches, list[WallAgreement]]:
    """The changes (n, 6) of poses, those that are not taken aside, the matches that they stand on, and how walls agree then."""
    change = np.zeros((len(start), 6))
    usable = np.array(taken)
    found, alike = before
    found = found.select(usable[found.panorama].all(axis=1))
    for _ in range(ROUNDS):
        if not len(found):
            break
        change = adjustment.solve(found, change)
        change[~usable] = 0.0
        poses = [_changed(pose, one) for pose, one in zip(start, change, strict=True)]
        found, alike = match_shared_walls(scene, surfaces, images, poses, AGAIN_M, poses_agree=True)
        found = found.select(usable[found.panorama].all(axis=1))
    return change, found, alike


def _worse(
    adjustment: BundleAdjustment,
    change: np.ndarray,
    found: PatchMatches,
    lines: Sequence[WallLines],
    before: Sequence[WallAgreement],
    after: Sequence[WallAgreement],
) -> dict[int, str]:
    """The panoramas that are not better together, and why: those of the first test that some fail, as others may fail the next
    by theirs."""
    still = np.zeros_like(change)
    apart = adjustment.match_distances(found, still)
    left_out = np.empty(len(found))
    half = _halves(found)
    for number in (0, 1):
        rest = adjustment.solve(found.select(half != number), still)
        left_out[half == number] = adjustment.match_distances(found.select(half == number), rest)
    tests: list[dict[int, str]] = [{}, {}, {}, {}]
    for number, own in enumerate(change):
        if not own.any():
            continue
        its, turn, still_turn = (found.panorama == number).any(axis=1), _turn(own), np.eye(3)
        moved, (was, now) = float(np.hypot(*own[:2])), _agreement(number, before, after)
        if moved > MOST_M:
            tests[0][number] = f"alone: others would move it by {moved:.1f} m"
        if len(lines[number]) and line_misfit(lines[number], turn) > (1 + WORSE_LINES) * line_misfit(lines[number], still_turn):
            tests[1][number] = "alone: its lines on walls would be less level and upright"
        if now < was - WORSE_WALLS:
            tests[2][number] = f"alone: what it shows would agree {now:.2f} with others, and does {was:.2f}"
        if its.any() and np.median(left_out[its]) > np.median(apart[its]) + WORSE_M:
            tests[3][number] = "alone: patches that were left out would lie farther apart"
    return next(filter(None, tests), {})


def _halves(found: PatchMatches) -> np.ndarray:
    """0 or 1 for each match (k,): of a pair's walls every other one, of fewer than SOME_WALLS the upper and the lower part of
    each: half of them would not tell a pose."""
    half = np.zeros(len(found), np.int64)
    for pair in np.unique(found.panorama, axis=0):
        rows = np.flatnonzero((found.panorama == pair).all(axis=1))
        walls, at = np.unique(found.chart[rows], return_inverse=True)
        for number in range(len(walls)):
            of = rows[at == number]
            half[of] = number % 2 if len(walls) >= SOME_WALLS else np.arange(len(of)) * 2 // len(of)
    return half


def _agreement(number: int, before: Sequence[WallAgreement], after: Sequence[WallAgreement]) -> tuple[float, float]:
    """How well the walls of a panorama agree with others, on the mean of those that are compared both before and after."""
    scores = [{(one.panorama, one.chart): one.score for one in of if number in one.panorama} for of in (before, after)]
    both = sorted(scores[0].keys() & scores[1].keys())
    if not both:
        return 0.0, 0.0
    was, now = (float(np.mean([of[key] for key in both])) for of in scores)
    return was, now


def _turn(change: np.ndarray) -> np.ndarray:
    """The turn (3, 3) of the world of a change (6,)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.radians(change[3:])).as_matrix())


def _changed(pose: Pose, change: np.ndarray) -> Pose:
    x, y, z = (camera_position(pose) + change[:3]).round(DIGITS).tolist()
    after = rotate_pose(pose, _turn(change))
    heading, pitch, roll = (round(angle, DIGITS) for angle in (after.heading, after.pitch, after.roll))
    return replace(after, x=x, y=y, z=z, heading=heading, pitch=pitch, roll=roll)
