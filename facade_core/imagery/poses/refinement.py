"""Poses of panoramas are never exact: turn and place are refined against the lines on walls and the outlines of the mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.outlines import (
    LEVEL_PULL,
    STATED_PULL,
    Gradients,
    OutlineSamples,
    PlaceEstimate,
    find_place,
    outline_fit,
    sample_outline,
    search_gradients,
)
from facade_core.imagery.poses.panorama_camera import camera_position, rotate_pose
from facade_core.imagery.poses.wall_lines import WallLines, detect_wall_lines, line_misfit, median_slope, solve_turn

# Fewer lines, or a sum of their lengths below this, do not tell a turn; nor does a turn beyond the last figure.
LEAST_LINES, LEAST_LENGTH, MOST_TURN_DEG = 24, 0.8, 6.0
# A turn is taken only if it lowers the misfit of the lines by this share.
BETTER_LINES = 0.05
# Groups of outline samples, and the sum of their lengths in radians, below which they do not tell a place.
LEAST_GROUPS, LEAST_OUTLINE = 10, 0.5
# A place is taken only if the fit there is this good, and better by this much.
LEAST_FIT, BETTER_FIT = 0.3, 0.06
# Expected errors of the heading in degrees, before and after lines have told it.
HEADING_DEG, TOLD_DEG = 1.0, 0.1
# Heights above the given one, metres, from which a place is looked for too: other eaves stand against the sky there.
STARTS_M = (-2.0, 2.0)
# A place found so far above or below where it was looked for from is looked for again from there, so often at most; one that is
# farther from the given one than the last, metres on the level and in height, is none.
RAISED_M, AGAIN, FARTHEST_M = 0.15, 2, (1.5, 3.0)
# A height that was mended may be the model's error: the share of it that is expected to be wrong.
OF_RAISED = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class RefinedPose:
    """A refined pose, or the given one with the reasons why not.

    given_degrees, residual_degrees: median angle between lines and axes on the rectified walls, before and after, NaN
    without lines; given_fit, fit: how well the mesh's outlines lie on edges of the picture, 0 to 1, before (the turn refined)
    and after; moved_m, turned_deg: what was changed; lines, outlines: the evidence, counted; reasons: what was left as given;
    spread (4, 4): the covariance of the place, metres east, north and up, and of the heading, degrees, as outlines tell them;
    None where they do not.
    """

    pose: Pose
    given_degrees: float
    residual_degrees: float
    given_fit: float
    outline_fit: float
    moved_m: float
    turned_deg: float
    lines: int
    outlines: int
    reasons: tuple[str, ...]
    covariance: np.ndarray | None


def refine_pose(scene: Scene, image: np.ndarray, pose: Pose, *, height_is_assumed: bool = False) -> RefinedPose:
    """The pose of a panorama, corrected by up to about a metre and a few degrees, where the picture says so clearly; by up to
    three metres in height, but where that is `height_is_assumed`, as of `find_place`.

    First the turn: lines on walls must be level or upright there, whatever the place. Then the place, and the last tenth of a
    degree of the heading: corners, eaves and silhouettes of the mesh must lie on edges of the picture; it is drawn to the
    given one. Either stays as given without clear evidence. image (H, W, 3) uint8 is the part pose.view of the full panorama.
    Raises GeometryError for a pose without height, ImageError for an image that is not uint8 RGB.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise ImageError(f"a panorama is uint8 RGB (h, w, 3), not {image.dtype} {image.shape}; convert it")
    camera_position(pose)
    reasons = []
    lines = detect_wall_lines(scene, image, pose)
    still = np.eye(3)
    turn, why = _turn(lines)
    if why:
        reasons.append(why)
    upright = rotate_pose(pose, turn) if not why else pose
    edges = sample_outline(scene, upright)
    groups = int((edges.weight > 0).sum())
    found, before, after, spread = upright, float("nan"), float("nan"), None
    if not _enough(edges):
        reasons.append(
            f"place as given: {groups} outlines of buildings are in sight, at least {LEAST_GROUPS} are needed"
        )
    else:
        search = _Search(scene, search_gradients(image, upright), upright, HEADING_DEG if why else TOLD_DEG, height_is_assumed)
        places = [search.search_from_height(up) for up in ((0.0,) if height_is_assumed else (0.0, *STARTS_M))]
        best = search.search_again(max((one for one in places if one is not None), key=search.score))
        before, after = outline_fit(edges, search.pictures[1], upright, np.zeros(3)), best.fit
        spread = best.covariance if after >= LEAST_FIT and search.score(best) > 0 else None
        if spread is None or after - before < BETTER_FIT:
            reasons.append(f"place as given: the outlines fit {before:.2f} there and at best {after:.2f}")
            after = before
            if spread is not None:  # they tell it: it is off by so much at most
                spread = spread + np.diag(np.append(best.offset, best.turn_deg) ** 2)
        else:
            found, turn = search.pose_at(best.offset, best.turn_deg), _about_z(-best.turn_deg) @ turn
            spread = best.covariance + np.diag([0.0, 0.0, (OF_RAISED * best.offset[2]) ** 2, 0.0])
    some = len(lines) > 0
    return RefinedPose(
        pose=found,
        given_degrees=median_slope(lines, still) if some else float("nan"),
        residual_degrees=median_slope(lines, turn) if some else float("nan"),
        given_fit=before,
        fit=after,
        moved_m=float(np.linalg.norm(camera_position(found) - camera_position(pose))),
        turned_deg=_angle(turn),
        lines=len(lines),
        outlines=groups,
        reasons=tuple(reasons),
        covariance=spread,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The search for the place of a panorama by outlines; places are offsets from its pose, wherever they were looked for."""

    scene: Scene
    pictures: tuple[Gradients, Gradients]
    pose: Pose
    heading_deg: float
    height_is_assumed: bool

    def search_from_height(self, up: float) -> PlaceEstimate | None:
        """The place that is found from so far above, metres, None where too little is in sight from there."""
        return self._search_from(np.array([0.0, 0.0, up]), 0.0)

    def search_again(self, place: PlaceEstimate) -> PlaceEstimate:
        """A place, or the one that is found from there, where it fits as well."""
        start = 0.0 if self.height_is_assumed else min((0.0, *STARTS_M), key=lambda up: abs(place.offset[2] - up))
        for _ in range(AGAIN):
            if abs(place.offset[2] - start) <= RAISED_M:
                break
            start, again = float(place.offset[2]), self._search_from(place.offset, place.turn_deg)
            if again is None or self.score(again) < max(LEAST_FIT, self.score(place)) - BETTER_FIT:
                break
            place = again
        return place

    def score(self, place: PlaceEstimate) -> float:
        """The fit, less for what is farther from the pose; least of all what is too far."""
        level, up = float(np.hypot(*place.offset[:2])), abs(float(place.offset[2]))
        if level > FARTHEST_M[0] or up > FARTHEST_M[1]:
            return -1.0
        return place.fit - LEVEL_PULL * level**2 - STATED_PULL * up**2

    def pose_at(self, offset: np.ndarray, turn_deg: float) -> Pose:
        """The pose moved by metres (3,) and turned clockwise from above."""
        x, y, z = camera_position(self.pose) + offset
        return replace(rotate_pose(self.pose, _about_z(-turn_deg)), x=float(x), y=float(y), z=float(z))

    def _search_from(self, offset: np.ndarray, turn_deg: float) -> PlaceEstimate | None:
        pose = self.pose_at(offset, turn_deg)
        edges = sample_outline(self.scene, pose)
        if not _enough(edges):
            return None
        found = find_place(edges, self.pictures, pose, heading_deg=self.heading_deg, height_is_assumed=self.height_is_assumed)
        return replace(found, offset=offset + found.offset, turn_deg=turn_deg + found.turn_deg)


def _enough(edges: OutlineSamples) -> bool:
    """Whether outlines may tell a place."""
    return int((edges.weight > 0).sum()) >= LEAST_GROUPS and float(edges.weight.sum()) >= LEAST_OUTLINE


def _turn(lines: WallLines) -> tuple[np.ndarray, str]:
    """The turn (3, 3) of the world that lines tell, and why it is none."""
    still = np.eye(3)
    if len(lines) < LEAST_LINES or lines.weight.sum() < LEAST_LENGTH:
        return (
            still,
            f"turn as given: {len(lines)} lines on walls in sight, at least {LEAST_LINES} long ones are needed",
        )
    turn, _ = solve_turn(lines)
    if _angle(turn) > MOST_TURN_DEG:
        return still, f"turn as given: the lines on walls ask for {_angle(turn):.1f} degrees; check the heading"
    if line_misfit(lines, turn) > (1 - BETTER_LINES) * line_misfit(lines, still):
        return (
            still,
            f"turn as given: lines on walls are {median_slope(lines, still):.2f} degrees off and would stay so",
        )
    return turn, ""


def _angle(turn: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))


def _about_z(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
