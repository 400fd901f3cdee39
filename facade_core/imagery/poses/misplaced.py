"""Pictures that were not taken as their pose says: mirrored, turned or moved the mesh's outlines fit them clearly better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.outlines import (
    COARSE,
    Gradients,
    OutlineSamples,
    find_place,
    image_gradients,
    outline_fit,
    sample_outline,
    search_gradients,
)
from facade_core.imagery.poses.panorama_camera import camera_position

# The outlines fit somewhere else where they fit so well there, and better by this: by chance they fit up to .23 anywhere, and
# where a picture was taken from .35 on.
LEAST_FIT, BETTER_FIT = 0.3, 0.12
# So many groups of outlines in sight tell one place from another.
PLENTY = 40
# Headings that are tried, degrees, but for those within the first of the given one.
TURNED_DEG, EACH_DEG = 5.0, 1.0
# Places that are tried, metres to either side and between, on a panorama so small (pixels of a full turn, blur) that a step
# does not miss a fit; within the last figure of the pose it is where it says.
MOVED_M, EACH_M, SMALL, HERE_M = 8.0, 0.5, (768, 2.0), 1.5
# Where the mirror image is looked for around the pose: metres and degrees.
BESIDE_M, BESIDE_DEG = np.arange(-1.0, 1.01, 0.25), np.arange(-2.0, 2.1, 1.0)


def explain_misplacement(scene: Scene, image: np.ndarray, pose: Pose, edges: OutlineSamples, best_fit: float) -> str:
    """Why a picture was not taken at its pose, with the remedy; empty where nothing says so.

    edges: what the mesh shows from the pose; fitting: how well it fits there at best, 0 to 1. image (H, W, 3) uint8 is the
    part pose.view of the full panorama.
    """
    least = max(LEAST_FIT, best_fit + BETTER_FIT)
    if int((edges.weight > 0).sum()) < PLENTY or least > 1:
        return ""
    pictures = search_gradients(image, pose)
    picture = pictures[0]
    if pose.view == (0.0, 0.0, 1.0, 1.0):
        mirrored = image_gradients(np.ascontiguousarray(image[:, ::-1]), pose, *COARSE)
        if (found := _beside(edges, mirrored, pose)) >= least:
            return (
                f"is mirrored: outlines of buildings fit its mirror image {found:.2f} and itself {best_fit:.2f}; turn it over, "
                "or remove it"
            )
    turns = np.arange(TURNED_DEG, 360 - TURNED_DEG + 1e-9, EACH_DEG)
    turn = float(turns[int(np.argmax([outline_fit(edges, picture, pose, np.zeros(3), one) for one in turns]))])
    turned = replace(pose, heading=(pose.heading + turn) % 360)
    if (found := find_place(edges, pictures, turned, heading_deg=1.0).fit) >= least:
        off = (turned.heading - pose.heading + 180) % 360 - 180
        return (
            f"is turned: outlines of buildings fit {found:.2f} at a heading {off:+.0f} degrees off and {best_fit:.2f} at its "
            "own; mend its heading, or remove it"
        )
    moved = _moved(edges, image_gradients(image, pose, *SMALL), pose)
    if (
        moved is not None
        and (found := find_place(sample_outline(scene, moved), pictures, moved, heading_deg=1.0).fit) >= least
    ):
        east, north = (camera_position(moved) - camera_position(pose))[:2]
        return (
            f"was taken elsewhere: outlines of buildings fit {found:.2f} about {east:+.1f} m east and {north:+.1f} m north of "
            f"its place and {best_fit:.2f} there; mend its place, or remove it"
        )
    return ""


def _beside(edges: OutlineSamples, picture: Gradients, pose: Pose) -> float:
    """How well outlines fit a picture near a pose, at best."""
    offsets = np.stack(np.meshgrid(BESIDE_M, BESIDE_M, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    return max(outline_fit(edges, picture, pose, offset, float(turn)) for offset in offsets for turn in BESIDE_DEG)


def _moved(edges: OutlineSamples, picture: Gradients, pose: Pose) -> Pose | None:
    """The pose on a grid around a pose at which the outlines in sight of it fit best; None where that is beside it."""
    level = np.arange(-MOVED_M, MOVED_M + 1e-9, EACH_M)
    offsets = np.stack(np.meshgrid(level, level, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    best = offsets[int(np.argmax([outline_fit(edges, picture, pose, offset) for offset in offsets]))]
    if np.hypot(*best[:2]) <= HERE_M:
        return None
    return replace(pose, x=pose.x + float(best[0]), y=pose.y + float(best[1]))
