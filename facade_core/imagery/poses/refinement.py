"""Single refinement of panorama poses: rotation by lines on walls, position by outlines of the mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_position, rotate_pose, rotation_about_z, rotation_angle_deg
from facade_core.imagery.poses.outlines import (
    CameraPositionEstimate,
    Gradients,
    OutlineSamples,
    coarse_and_fine_gradients,
    fit_camera_position,
    outline_fit,
    sample_visible_outlines,
)
from facade_core.imagery.poses.settings import OUTLINES, REFINEMENT
from facade_core.imagery.poses.wall_lines import (
    WallLines,
    detect_wall_lines,
    line_misfit,
    median_line_angle,
    solve_rotation_from_lines,
)


@dataclass(frozen=True, slots=True, eq=False)
class RefinedPose:
    """Pose after refinement, or the stated one with the reasons.

    Attributes
    ----------
    pose : the pose.
    given_degrees : median angle between lines and axes on the rectified walls with the stated pose, NaN without lines.
    residual_degrees : the same with the refined pose.
    given_fit : fit of the outlines to image edges, 0 to 1, with the stated position and the refined rotation.
    fit : the same with the refined pose.
    moved_m : change of the position in metres.
    turned_deg : change of the rotation in degrees.
    lines : number of lines.
    outlines : number of outline groups.
    reasons : reasons why parts of the pose stay as stated.
    covariance : (4, 4) of the position (metres east, north, up) and heading (degrees), None where outlines do not
        determine it.
    """

    pose: Pose
    given_degrees: float
    residual_degrees: float
    given_fit: float
    fit: float
    moved_m: float
    turned_deg: float
    lines: int
    outlines: int
    reasons: tuple[str, ...]
    covariance: Float64Array | None


def refine_pose(scene: Scene, image: UInt8Array, pose: Pose, *, height_is_assumed: bool = False) -> RefinedPose:
    """Refine the pose of a panorama by about a metre and a few degrees, where the evidence is clear.

    The rotation comes first: lines on walls must be level or upright, at any position. Then the position and the last
    tenth of a degree of the heading: corners, eaves and silhouettes of the mesh must match image edges. The height may
    change by up to three metres unless it is assumed. Position and rotation stay as stated without clear evidence.

    Parameters
    ----------
    scene : scene that contains the mesh.
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : stated pose.
    height_is_assumed : as in `fit_camera_position`.

    Raises
    ------
    GeometryError
        If the pose has no height.
    ImageError
        If the image is not uint8 RGB.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise ImageError(f"a panorama is uint8 RGB (h, w, 3), not {image.dtype} {image.shape}; convert it")
    camera_position(pose)
    reasons = []
    lines = detect_wall_lines(scene, image, pose)
    identity = np.eye(3)
    rotation, reason = _line_rotation(lines)
    if reason:
        reasons.append(reason)
    levelled = rotate_pose(pose, rotation) if not reason else pose
    outline = sample_visible_outlines(scene, levelled)
    groups = int((outline.weight > 0).sum())
    refined, fit_before, fit_after, covariance = levelled, float("nan"), float("nan"), None
    if not _is_sufficient(outline, pose):
        needed = _needed_groups(pose)
        reasons.append(f"place as given: {groups} outlines of buildings are in sight, at least {needed} are needed")
    else:
        search = _Search(
            scene,
            coarse_and_fine_gradients(image, levelled),
            levelled,
            REFINEMENT.heading_sigma_deg if reason else REFINEMENT.line_heading_sigma_deg,
        )
        best = search.search_at_height() if height_is_assumed else search.search_freely()
        fit_before, fit_after = outline_fit(outline, search.pictures[1], levelled, np.zeros(3)), best.fit
        covariance = best.covariance if fit_after >= REFINEMENT.min_fit and search.score(best) > 0 else None
        why = f"the outlines fit {fit_before:.2f} there and at best {fit_after:.2f}"
        if covariance is not None and fit_after - fit_before >= REFINEMENT.min_fit_gain:
            why = search.refute(best, lines, rotation)
        if why:
            reasons.append(f"place as given: {why}")
            fit_after = fit_before
            if covariance is not None:  # the search bounds the error of the stated position
                covariance = covariance + np.diag(np.append(best.offset, best.turn_deg) ** 2)
        else:
            refined, rotation = search.pose_at(best.offset, best.turn_deg), rotation_about_z(-best.turn_deg) @ rotation
            covariance = best.covariance + np.diag(
                [0.0, 0.0, (REFINEMENT.height_change_error * best.offset[2]) ** 2, 0.0]
            )
    has_lines = len(lines) > 0
    return RefinedPose(
        pose=refined,
        given_degrees=median_line_angle(lines, identity) if has_lines else float("nan"),
        residual_degrees=median_line_angle(lines, rotation) if has_lines else float("nan"),
        given_fit=fit_before,
        fit=fit_after,
        moved_m=float(np.linalg.norm(camera_position(refined) - camera_position(pose))),
        turned_deg=rotation_angle_deg(rotation),
        lines=len(lines),
        outlines=groups,
        reasons=tuple(reasons),
        covariance=covariance,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Search for the position of a panorama; positions are offsets from its pose."""

    scene: Scene
    pictures: tuple[Gradients, Gradients]
    pose: Pose
    heading_deg: float

    def search_freely(self) -> CameraPositionEstimate:
        """Search from several heights; a height that buildings do not agree on stays as stated, with its error."""
        candidates = [self.search_from_height(up) for up in (0.0, *REFINEMENT.start_heights_m)]
        best = self.search_again(max(filter(None, candidates), key=self.score))
        change = float(best.offset[2])
        if abs(change) >= REFINEMENT.min_height_change_m and self.find_agreement(best, (0, 1, 2)) >= (
            REFINEMENT.min_height_agreement
        ):
            return best
        held = self.search_at_height()
        return replace(held, covariance=held.covariance + np.diag([0.0, 0.0, change**2, 0.0]))

    def search_from_height(self, up: float) -> CameraPositionEstimate | None:
        """Search from a height above the pose in metres; None if too little is visible there."""
        return self._search_from(np.array([0.0, 0.0, up]), 0.0)

    def search_again(self, place: CameraPositionEstimate) -> CameraPositionEstimate:
        """Restart the search from a position while the result fits as well."""
        start = min((0.0, *REFINEMENT.start_heights_m), key=lambda up: abs(place.offset[2] - up))
        for _ in range(REFINEMENT.max_restarts):
            if abs(place.offset[2] - start) <= REFINEMENT.min_restart_m:
                break
            start, found = float(place.offset[2]), self._search_from(place.offset, place.turn_deg)
            if (
                found is None
                or self.score(found) < max(REFINEMENT.min_fit, self.score(place)) - REFINEMENT.min_fit_gain
            ):
                break
            place = found
        return place

    def score(self, place: CameraPositionEstimate) -> float:
        """Fit minus a penalty for the distance from the pose; -1 if too far."""
        level, up = float(np.hypot(*place.offset[:2])), abs(float(place.offset[2]))
        if level > REFINEMENT.max_offset_m[0] or up > REFINEMENT.max_offset_m[1]:
            return -1.0
        return place.fit - OUTLINES.horizontal_cost * level**2 - OUTLINES.stated_height_cost * up**2

    def search_at_height(self) -> CameraPositionEstimate:
        """Search at the stated height."""
        edges = sample_visible_outlines(self.scene, self.pose)
        found = fit_camera_position(
            edges, self.pictures, self.pose, heading_deg=self.heading_deg, height_is_assumed=True
        )
        offset = found.offset * (1, 1, 0)
        return replace(
            found, offset=offset, fit=outline_fit(edges, self.pictures[1], self.pose, offset, found.turn_deg)
        )

    def find_agreement(self, place: CameraPositionEstimate, axes: Sequence[int]) -> float:
        """Return the share of the outlines whose building fits hardly better, alone, anywhere along these axes."""
        pose = self.pose_at(place.offset, place.turn_deg)
        edges = sample_visible_outlines(self.scene, pose)
        share = 0.0
        for building in np.unique(edges.building).tolist():
            own = edges.select_building(building)
            fit = outline_fit(own, self.pictures[1], pose, np.zeros(3))
            tried = [
                outline_fit(own, self.pictures[1], pose, at * np.eye(3)[axis])
                for axis in axes
                for at in np.arange(-1, 1 + 1e-9, 0.08) * REFINEMENT.agreement_reach_m[axis]
            ]
            if max(tried) - fit <= REFINEMENT.max_agreement_loss:
                share += float(own.weight.sum())
        return share / max(float(edges.weight.sum()), 1e-9)

    def refute(self, place: CameraPositionEstimate, lines: WallLines, rotation: Float64Array) -> str:
        """Return what speaks against a place, "" for nothing."""
        turned = rotation_about_z(-place.turn_deg) @ rotation
        if len(lines) and line_misfit(lines, turned) > (1 + REFINEMENT.max_misfit_increase) * line_misfit(
            lines, rotation
        ):
            return "lines on walls would be less level and upright"
        agreeing = self.find_agreement(place, (0, 1))
        if agreeing < REFINEMENT.min_place_agreement:
            return f"buildings with only {agreeing:.0%} of the outlines fit best at one place"
        return ""

    def pose_at(self, offset: Float64Array, turn_deg: float) -> Pose:
        """Return the pose translated by metres (3,) and turned clockwise from above."""
        x, y, z = camera_position(self.pose) + offset
        return replace(rotate_pose(self.pose, rotation_about_z(-turn_deg)), x=float(x), y=float(y), z=float(z))

    def _search_from(self, offset: Float64Array, turn_deg: float) -> CameraPositionEstimate | None:
        pose = self.pose_at(offset, turn_deg)
        edges = sample_visible_outlines(self.scene, pose)
        if not _is_sufficient(edges, pose):
            return None
        found = fit_camera_position(edges, self.pictures, pose, heading_deg=self.heading_deg)
        return replace(found, offset=offset + found.offset, turn_deg=turn_deg + found.turn_deg)


def _is_sufficient(edges: OutlineSamples, pose: Pose) -> bool:
    """Return True if outlines may determine a position."""
    return (
        int((edges.weight > 0).sum()) >= _needed_groups(pose)
        and float(edges.weight.sum()) >= REFINEMENT.min_outline_length
    )


def _needed_groups(pose: Pose) -> int:
    return REFINEMENT.min_outline_groups if pose.lens is None else REFINEMENT.min_lens_outline_groups


def _line_rotation(lines: WallLines) -> tuple[Float64Array, str]:
    """World rotation (3, 3) from lines, and the reason if it is rejected."""
    identity = np.eye(3)
    if len(lines) < REFINEMENT.min_lines or lines.weight.sum() < REFINEMENT.min_line_length:
        return (
            identity,
            f"turn as given: {len(lines)} lines on walls in sight, at least {REFINEMENT.min_lines} long ones are needed",
        )
    rotation = solve_rotation_from_lines(lines)
    if rotation_angle_deg(rotation) > REFINEMENT.max_turn_deg:
        return (
            identity,
            f"turn as given: the lines on walls ask for {rotation_angle_deg(rotation):.1f} degrees; check the heading",
        )
    if line_misfit(lines, rotation) > (1 - REFINEMENT.min_misfit_decrease) * line_misfit(lines, identity):
        return (
            identity,
            f"turn as given: lines on walls are {median_line_angle(lines, identity):.2f} degrees off and would stay so",
        )
    return rotation, ""
