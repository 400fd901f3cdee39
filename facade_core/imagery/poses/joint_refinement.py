"""Joint refinement of panoramas that show the same walls, after each was refined alone (`refine_pose`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_position, pixels_per_radian, rotate_pose
from facade_core.imagery.poses.bundle_adjustment import BundleAdjustment
from facade_core.imagery.poses.settings import JOINT
from facade_core.imagery.poses.shared_walls import PatchMatches, SurfaceCorrelation, match_patches_between_panoramas
from facade_core.imagery.poses.wall_lines import WallLines, detect_wall_lines, line_misfit, median_line_angle

# Unknowns that outlines determine.
OUTLINE_UNKNOWNS = np.array([0, 1, 2, 5])
# Their signs: outlines count turns clockwise from above, the equations counter-clockwise.
OUTLINE_SIGNS = np.array([1, 1, 1, -1])


@dataclass(frozen=True, slots=True, eq=False)
class PriorPose:
    """Pose from single refinement, the start of joint refinement.

    Attributes
    ----------
    pose : refined pose.
    covariance : (4, 4) as in `RefinedPose`, None where outlines did not determine the position.
    """

    pose: Pose
    covariance: Float64Array | None


@dataclass(frozen=True, slots=True)
class JointPose:
    """Jointly refined pose, or the prior one with the reason for the rejection.

    Attributes
    ----------
    pose : the pose.
    reason : reason why the prior pose is kept, "" for none.
    surfaces : number of walls and ground pieces on which others agree.
    distance_before : median distance in metres between common patches with the prior poses, NaN without patches.
    distance_after : the same with the joint poses.
    residual_degrees : as in `RefinedPose`.
    """

    pose: Pose
    reason: str
    surfaces: int
    distance_before: float
    distance_after: float
    residual_degrees: float


def refine_jointly(
    scene: Scene, surfaces: Sequence[int], images: Iterable[UInt8Array], alone: Sequence[PriorPose]
) -> list[JointPose]:
    """Refine the poses of a bundle of panoramas by common walls and ground.

    Repeats `match_patches_between_panoramas` and `BundleAdjustment`. A panorama keeps its prior pose, and the others are
    refined without it, if the joint pose is worse by held-out patches, by its lines or by the agreement of whole walls.

    Parameters
    ----------
    scene : scene that contains the surfaces.
    surfaces : charts that more than one panorama may show.
    images : (H, W, 3) uint8 as in `rectify_chart_from_panorama`; consumed one at a time, a downscaled picture of each is kept.
    priors : poses from single refinement.

    Returns
    -------
    One result per panorama.
    """
    start = [prior.pose for prior in alone]
    lines, downscaled = [], []
    for image, pose in zip(images, start, strict=True):
        lines.append(detect_wall_lines(scene, image, pose))
        downscaled.append(downscale_panorama(image, pose))
    adjustment = BundleAdjustment(scene, start, lines, np.array([_prior_covariance(prior) for prior in alone]))
    before = match_patches_between_panoramas(scene, surfaces, downscaled, start, JOINT.first_search_m)
    reasons = [""] * len(start)
    while True:
        change, matches, agreements = _adjust(
            scene, surfaces, downscaled, start, adjustment, before, [not prior for prior in reasons]
        )
        rejected = _find_worse(adjustment, change, matches, lines, before[1], agreements)
        if not rejected:
            break
        for number, reason in rejected.items():
            reasons[number] = reason
    no_change = np.zeros_like(change)
    distances = [adjustment.match_distances(matches, prior) for prior in (no_change, change)]
    results = []
    for number, prior in enumerate(alone):
        is_own = (matches.panorama == number).any(axis=1)
        was, now = (float(np.median(distance[is_own])) if is_own.any() else float("nan") for distance in distances)
        reason = reasons[number] or (
            "" if is_own.any() else "alone: nothing in sight agrees with what others show of it"
        )
        pose, turn = (
            (prior.pose, np.eye(3))
            if reason
            else (_apply_change(prior.pose, change[number]), _rotation(change[number]))
        )
        tilt = median_line_angle(lines[number], turn) if len(lines[number]) else float("nan")
        results.append(JointPose(pose, reason, len(np.unique(matches.chart[is_own])), was, now, tilt))
    return results


def downscale_panorama(image: UInt8Array, pose: Pose) -> UInt8Array:
    """Downscale a panorama (H, W, 3) uint8 to at most max_turn_pixels per full turn."""
    import cv2

    shrink = JOINT.max_turn_pixels * pose.view[2] / image.shape[1]
    if pose.lens is not None:
        shrink = JOINT.max_turn_pixels / (2 * np.pi) / pixels_per_radian(pose, image.shape[1])
    if shrink >= 1:
        return image
    size = (max(1, round(image.shape[1] * shrink)), max(1, round(image.shape[0] * shrink)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _prior_covariance(prior: PriorPose) -> Float64Array:
    """Covariance (6, 6) of a prior pose: metres, then degrees about the axes."""
    if prior.covariance is None:
        return np.diag(np.array(JOINT.sigma_without_outlines) ** 2)
    covariance = np.diag(np.array(JOINT.sigma_with_outlines) ** 2)
    covariance[np.ix_(OUTLINE_UNKNOWNS, OUTLINE_UNKNOWNS)] += prior.covariance * np.outer(OUTLINE_SIGNS, OUTLINE_SIGNS)
    return covariance


def _adjust(
    scene: Scene,
    surfaces: Sequence[int],
    images: Sequence[UInt8Array],
    start: Sequence[Pose],
    adjustment: BundleAdjustment,
    before: tuple[PatchMatches, list[SurfaceCorrelation]],
    is_included: Sequence[bool],
) -> tuple[Float64Array, PatchMatches, list[SurfaceCorrelation]]:
    """Return the changes (n, 6) of the included poses, the matches behind them, and the agreement of walls afterwards."""
    change = np.zeros((len(start), 6))
    usable = np.array(is_included)
    matches, agreements = before
    matches = matches.select(np.asarray(usable[matches.panorama].all(axis=1)))
    for _ in range(JOINT.rounds):
        if not len(matches):
            break
        change = adjustment.solve(matches, change)
        change[~usable] = 0.0
        poses = [_apply_change(pose, pose_change) for pose, pose_change in zip(start, change, strict=True)]
        matches, agreements = match_patches_between_panoramas(
            scene, surfaces, images, poses, JOINT.later_search_m, poses_agree=True
        )
        matches = matches.select(np.asarray(usable[matches.panorama].all(axis=1)))
    return change, matches, agreements


def _find_worse(
    adjustment: BundleAdjustment,
    change: Float64Array,
    matches: PatchMatches,
    lines: Sequence[WallLines],
    before: Sequence[SurfaceCorrelation],
    after: Sequence[SurfaceCorrelation],
) -> dict[int, str]:
    """Panoramas with a worse joint pose, and the reason, by the first test that any of them fails.

    Later tests are skipped: others may fail them because of these panoramas.
    """
    no_change = np.zeros_like(change)
    distances = adjustment.match_distances(matches, no_change)
    holdout_distances = np.empty(len(matches))
    half = _split_holdout(matches)
    for number in (0, 1):
        rest = adjustment.solve(matches.select(half != number), no_change)
        holdout_distances[half == number] = adjustment.match_distances(matches.select(half == number), rest)
    tests: list[dict[int, str]] = [{}, {}, {}, {}]
    for number, own_change in enumerate(change):
        if not own_change.any():
            continue
        is_own, turn, still_turn = (matches.panorama == number).any(axis=1), _rotation(own_change), np.eye(3)
        moved, (was, now) = float(np.hypot(*own_change[:2])), _mean_agreement(number, before, after)
        if moved > JOINT.max_shift_m:
            tests[0][number] = f"alone: others would move it by {moved:.1f} m"
        if len(lines[number]) and line_misfit(lines[number], turn) > (1 + JOINT.max_misfit_increase) * line_misfit(
            lines[number], still_turn
        ):
            tests[1][number] = "alone: its lines on walls would be less level and upright"
        if now < was - JOINT.max_correlation_loss:
            tests[2][number] = f"alone: what it shows would agree {now:.2f} with others, and does {was:.2f}"
        if (
            is_own.any()
            and np.median(holdout_distances[is_own]) > np.median(distances[is_own]) + JOINT.max_distance_increase_m
        ):
            tests[3][number] = "alone: patches that were left out would lie farther apart"
    return next(filter(None, tests), {})


def _split_holdout(matches: PatchMatches) -> Int64Array:
    """Holdout half, 0 or 1, of each match (k,): every other wall of a pair.

    With fewer than min_holdout_walls walls, the upper and lower part of each: half of the walls would not determine a
    pose.
    """
    half = np.zeros(len(matches), np.int64)
    for pair in np.unique(matches.panorama, axis=0):
        rows = np.flatnonzero((matches.panorama == pair).all(axis=1))
        walls, wall_index = np.unique(matches.chart[rows], return_inverse=True)
        for number in range(len(walls)):
            wall_rows = rows[wall_index == number]
            half[wall_rows] = (
                number % 2 if len(walls) >= JOINT.min_holdout_walls else np.arange(len(wall_rows)) * 2 // len(wall_rows)
            )
    return half


def _mean_agreement(
    number: int, before: Sequence[SurfaceCorrelation], after: Sequence[SurfaceCorrelation]
) -> tuple[float, float]:
    """Mean agreement of a panorama's walls before and after, over the walls that have both."""
    scores = [{(one.panorama, one.chart): one.score for one in of if number in one.panorama} for of in (before, after)]
    both = sorted(scores[0].keys() & scores[1].keys())
    if not both:
        return 0.0, 0.0
    was, now = (float(np.mean([of[key] for key in both])) for of in scores)
    return was, now


def _rotation(change: Float64Array) -> Float64Array:
    """World rotation (3, 3) of a change (6,)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.radians(change[3:])).as_matrix())


def _apply_change(pose: Pose, change: Float64Array) -> Pose:
    x, y, z = (camera_position(pose) + change[:3]).round(JOINT.pose_digits).tolist()
    after = rotate_pose(pose, _rotation(change))
    heading, pitch, roll = (round(angle, JOINT.pose_digits) for angle in (after.heading, after.pitch, after.roll))
    return replace(after, x=x, y=y, z=z, heading=heading, pitch=pitch, roll=roll)
