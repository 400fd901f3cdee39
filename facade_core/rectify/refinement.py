"""Poses of panoramas are never exact: turn and place are refined against the lines on walls and the outlines of the mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from facade_core.errors import ImageError
from facade_core.rectify.camera import position, turned
from facade_core.rectify.outlines import Place, find_place, outline
from facade_core.rectify.wall_lines import Lines, median_slope, misfit, solve_turn, wall_lines
from facade_core.street.scene import Scene
from facade_core.types import Pose

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
# A place that is found so far above or below, metres, is looked for again with what is in sight there, so often at most.
RAISED_M, AGAIN = 0.15, 3


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
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
    fit: float
    moved_m: float
    turned_deg: float
    lines: int
    outlines: int
    reasons: tuple[str, ...]
    spread: np.ndarray | None


def refine_pose(scene: Scene, image: np.ndarray, pose: Pose, *, carried: bool = False) -> Refined:
    """The pose of a panorama, corrected by up to about a metre and a few degrees, where the picture says so clearly; by up to
    three metres in height, but for half a metre where that is `carried`, as of `find_place`.

    First the turn: lines on walls must be level or upright there, whatever the place. Then the place, and the last tenth of a
    degree of the heading: corners, eaves and silhouettes of the mesh must lie on edges of the picture; it is drawn to the
    given one. Either stays as given without clear evidence. image (H, W, 3) uint8 is the part pose.view of the full panorama.
    Raises GeometryError for a pose without height, ImageError for an image that is not uint8 RGB.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise ImageError(f"a panorama is uint8 RGB (h, w, 3), not {image.dtype} {image.shape}; convert it")
    position(pose)
    reasons = []
    lines = wall_lines(scene, image, pose)
    still = np.eye(3)
    turn, why = _turn(lines)
    if why:
        reasons.append(why)
    upright = turned(pose, turn) if not why else pose
    edges = outline(scene, upright)
    groups = int((edges.weight > 0).sum())
    found, before, after, spread = upright, float("nan"), float("nan"), None
    if groups < LEAST_GROUPS or edges.weight.sum() < LEAST_OUTLINE:
        reasons.append(
            f"place as given: {groups} outlines of buildings are in sight, at least {LEAST_GROUPS} are needed"
        )
    else:
        heading_deg = HEADING_DEG if why else TOLD_DEG
        place = find_place(edges, image, upright, heading_deg=heading_deg, carried=carried)
        before, after = place.given_fit, place.fit
        if after < LEAST_FIT or after - before < BETTER_FIT:
            reasons.append(f"place as given: the outlines fit {before:.2f} there and at best {after:.2f}")
            after = before
        else:
            found, turn = _at(upright, place), _about_z(-place.turn_deg) @ turn
            for _ in range(AGAIN):
                if abs(place.offset[2]) <= RAISED_M:
                    break
                # from another height other eaves stand against the sky
                place = find_place(outline(scene, found), image, found, heading_deg=heading_deg, carried=carried)
                found, turn = _at(found, place), _about_z(-place.turn_deg) @ turn
            after, spread = place.fit, place.spread
    some = len(lines) > 0
    return Refined(
        pose=found,
        given_degrees=median_slope(lines, still) if some else float("nan"),
        residual_degrees=median_slope(lines, turn) if some else float("nan"),
        given_fit=before,
        fit=after,
        moved_m=float(np.linalg.norm(position(found) - position(pose))),
        turned_deg=_angle(turn),
        lines=len(lines),
        outlines=groups,
        reasons=tuple(reasons),
        spread=spread,
    )


def _at(pose: Pose, place: Place) -> Pose:
    """A pose moved and turned to a place that was found from it."""
    x, y, z = position(pose) + place.offset
    return replace(turned(pose, _about_z(-place.turn_deg)), x=float(x), y=float(y), z=float(z))


def _turn(lines: Lines) -> tuple[np.ndarray, str]:
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
    if misfit(lines, turn) > (1 - BETTER_LINES) * misfit(lines, still):
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
