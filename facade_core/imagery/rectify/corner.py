"""Corner of a building in a photo: the second facade shares the vertical lines with the first, not the level ones."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.ties import first_maximum
from facade_core.imagery.rectify.settings import CORNER
from facade_core.imagery.rectify.vanishing import FacadeCamera, level_agreement, undistort


class Corner(NamedTuple):
    """Corner at which a facade ends and another facade of the building begins.

    Attributes
    ----------
    column : x of the corner on the facade's plane at distance 1.
    side : side of the facade on which the other is.
    """

    column: float
    side: Literal["left", "right"]


def find_corner(segments: Float64Array, view: FacadeCamera) -> Corner | None:
    """Find the corner between the facade that a camera sees and a second one; None without one.

    Parameters
    ----------
    segments : (n, 2, 2) lines in half diagonals from which the camera was found.
    view : camera that sees the facade.
    """
    straight = undistort(segments, view.distortion)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    yaws = np.radians(np.arange(-CORNER.max_second_yaw_deg, CORNER.max_second_yaw_deg + 0.5, 2.0))
    directions, agreement = level_agreement(straight, view, yaws)
    agreement[view.family >= 0] = 0
    cosine = np.abs(multiply_matrices(directions, view.rotation[:, 0]))
    scores = np.where(cosine < np.cos(np.radians(CORNER.min_corner_deg)), multiply_matrices(lengths, agreement), 0.0)
    second = agreement[:, first_maximum(scores)] > 0
    first = view.family == 0
    length = np.where(first | second, lengths, 0.0)
    if length[second].sum() < CORNER.min_second_share * length.sum():
        return None
    towards = np.concatenate([straight.mean(axis=1) / view.focal, np.ones((len(segments), 1))], axis=1)
    rays = multiply_matrices(towards, view.rotation)
    angle = np.arctan2(rays[:, 0], rays[:, 2])
    order = np.argsort(angle, kind="stable")
    order = order[length[order] > 0]
    signed = np.cumsum(np.where(first[order], length[order], -length[order]))
    # of the first facade left of a split and of the second right of it, and the other way round
    on_right = (signed + length[second].sum()) / length.sum()
    k = int(on_right.argmax() if on_right.max() > 1 - on_right.min() else on_right.argmin())
    if max(on_right[k], 1 - on_right[k]) < CORNER.min_separated_share or k + 1 >= len(order):
        return None
    split = (angle[order[k]] + angle[order[k + 1]]) / 2
    return Corner(float(np.tan(split)), "right" if on_right[k] > 0.5 else "left") if abs(split) < np.pi / 2 else None
