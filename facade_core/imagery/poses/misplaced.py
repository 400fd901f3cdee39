"""Detection of wrong poses: the mesh's outlines fit a mirrored, turned or moved picture clearly better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_position
from facade_core.imagery.poses.outlines import (
    Gradients,
    OutlineSamples,
    coarse_and_fine_gradients,
    fit_camera_position,
    image_gradients,
    outline_fit,
    sample_visible_outlines,
)
from facade_core.imagery.poses.settings import MISPLACED, OUTLINES


def explain_misplacement(scene: Scene, image: UInt8Array, pose: Pose, edges: OutlineSamples, best_fit: float) -> str:
    """Explain why a picture was not taken at its pose, with a remedy.

    Parameters
    ----------
    scene : scene that contains the mesh.
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : stated pose.
    edges : outlines of the mesh as seen from the pose.
    best_fit : best fit near the pose, 0 to 1.

    Returns
    -------
    The explanation, "" if nothing contradicts the pose, and for pictures of a lens.
    """
    if pose.lens is not None:  # a part of the outlines fits by chance
        return ""
    min_fit = max(MISPLACED.min_other_fit, best_fit + MISPLACED.min_fit_gain)
    if int((edges.weight > 0).sum()) < MISPLACED.min_outline_groups or min_fit > 1:
        return ""
    pictures = coarse_and_fine_gradients(image, pose)
    picture = pictures[0]
    if pose.view == (0.0, 0.0, 1.0, 1.0):
        mirrored = image_gradients(np.ascontiguousarray(image[:, ::-1]), pose, *OUTLINES.coarse_resolution)
        if (found_fit := _best_fit_nearby(edges, mirrored, pose)) >= min_fit:
            return (
                f"is mirrored: outlines of buildings fit its mirror image {found_fit:.2f} and itself {best_fit:.2f}; "
                "turn it over, or remove it"
            )
    turns = np.arange(MISPLACED.min_turn_deg, 360 - MISPLACED.min_turn_deg + 1e-9, MISPLACED.turn_step_deg)
    turn = float(
        turns[int(np.argmax([outline_fit(edges, picture, pose, np.zeros(3), turn_deg) for turn_deg in turns]))]
    )
    turned = replace(pose, heading=(pose.heading + turn) % 360)
    if (found_fit := fit_camera_position(edges, pictures, turned, heading_deg=1.0).fit) >= min_fit:
        difference = (turned.heading - pose.heading + 180) % 360 - 180
        return (
            f"is turned: outlines of buildings fit {found_fit:.2f} at a heading {difference:+.0f} degrees off and "
            f"{best_fit:.2f} at its own; mend its heading, or remove it"
        )
    moved = _best_grid_pose(edges, image_gradients(image, pose, *MISPLACED.grid_resolution), pose)
    if (
        moved is not None
        and (
            found_fit := fit_camera_position(
                sample_visible_outlines(scene, moved), pictures, moved, heading_deg=1.0
            ).fit
        )
        >= min_fit
    ):
        east, north = (camera_position(moved) - camera_position(pose))[:2]
        return (
            f"was taken elsewhere: outlines of buildings fit {found_fit:.2f} about {east:+.1f} m east and {north:+.1f} m north "
            f"of its place and {best_fit:.2f} there; mend its place, or remove it"
        )
    return ""


def _best_fit_nearby(edges: OutlineSamples, picture: Gradients, pose: Pose) -> float:
    """Best fit of the outlines near a pose."""
    offsets = np.stack(
        np.meshgrid(MISPLACED.mirror_offsets_m, MISPLACED.mirror_offsets_m, [0.0], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    return max(
        outline_fit(edges, picture, pose, offset, float(turn))
        for offset in offsets
        for turn in MISPLACED.mirror_turns_deg
    )


def _best_grid_pose(edges: OutlineSamples, picture: Gradients, pose: Pose) -> Pose | None:
    """Pose of the best fit on a grid around a pose; None if it is near the pose itself."""
    steps = np.arange(-MISPLACED.max_move_m, MISPLACED.max_move_m + 1e-9, MISPLACED.move_step_m)
    offsets = np.stack(np.meshgrid(steps, steps, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    best = offsets[int(np.argmax([outline_fit(edges, picture, pose, offset) for offset in offsets]))]
    if np.hypot(*best[:2]) <= MISPLACED.max_stated_error_m:
        return None
    return replace(pose, x=pose.x + float(best[0]), y=pose.y + float(best[1]))
