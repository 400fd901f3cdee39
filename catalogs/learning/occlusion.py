"""What stands in front of labelled facades whose labels run straight on behind it.

The labels of ECP and CMP say nothing of the vehicles and people before the ground floor. A detector has looked for these
in the photos that are trained on; in_front.json keeps the boxes that it found, in_front.md says where they come from.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy import ndimage

from catalogs.learning.datasets import LabelledFacade
from facade_core.labels import DOOR, SHOP, UNKNOWN
from facade_core.parse.cut_out import Box, cut_out
from facade_core.parse.network_views import ANY_CLASS

_BOXES = Path(__file__).with_name("in_front.json")
# The ground floor, as a share of the labelled rows: where no door or shop tells it, and at most.
_GROUND, _HIGHEST_GROUND = 0.25, 0.4
# Around a box not everything is wall yet: wheels, bags and shadows reach beyond it. Shares of its sides.
_MARGIN = 0.12
# Twice green less red and blue, of leaves.
_GREEN = 24


def boxes_in_front() -> dict[str, list[Box]]:
    """The detector's boxes by set and photo, as "ecp/monge_101"; every photo that it looked at has an entry."""
    found = json.loads(_BOXES.read_text(encoding="utf-8"))
    return {name: [tuple(box) for box in boxes] for name, boxes in found.items()}


def with_occluders(
    name: str, facades: Iterable[LabelledFacade], boxes: Mapping[str, Sequence[Box]]
) -> list[LabelledFacade]:
    """The facades of a set with another occluder map, of what can be said of them.

    Above the ground floor nothing is in front, but where leaves may be; what is in a box is. Of the ground floor, only the
    upper half is clear, where it is labelled and no box is near; the rest is not told.
    """
    return [
        dataclasses.replace(facade, occluder=_occluder(facade, boxes.get(f"{name}/{facade.name}")))
        for facade in facades
    ]


def _occluder(facade: LabelledFacade, boxes: Sequence[Box] | None) -> np.ndarray:
    labelled = facade.possible != ANY_CLASS
    if not labelled.any():
        return np.full(labelled.shape, UNKNOWN, np.uint8)
    top, bottom = ground_floor(facade)
    colours = facade.image.astype(np.int16)
    leaves = ndimage.maximum_filter(2 * colours[..., 1] - colours[..., 0] - colours[..., 2] > _GREEN, 9)
    occluder = np.where(labelled & ~leaves, 0, UNKNOWN).astype(np.uint8)
    # Without a detector's look the whole ground floor is not told.
    occluder[top if boxes is None else (top + bottom) // 2 :] = UNKNOWN
    height, width = occluder.shape
    for box in boxes or ():
        across, down = (round(_MARGIN * side) + 2 for side in (box[2] - box[0], box[3] - box[1]))
        near = np.s_[max(0, box[1] - down) : box[3] + down, max(0, box[0] - across) : box[2] + across]
        occluder[near] = UNKNOWN
    for box in boxes or ():
        x0, y0, x1, y1 = np.clip(box, 0, (width, height, width, height)).tolist()
        if x1 - x0 > 2 and y1 - y0 > 2:
            occluder[y0:y1, x0:x1][cut_out(facade.image, (x0, y0, x1, y1))] = 1
    return occluder


def ground_floor(facade: LabelledFacade) -> tuple[int, int]:
    """First row of the ground floor and the row below its last, by doors and shops in the lower part of the facade."""
    rows = np.flatnonzero((facade.possible != ANY_CLASS).any(1))
    high, bottom = int(rows[0]), int(rows[-1]) + 1
    highest = bottom - round(_HIGHEST_GROUND * (bottom - high))
    telling = (facade.labels == DOOR) | (facade.labels == SHOP)
    foot = highest + np.flatnonzero(telling[highest:bottom].any(1))
    top = bottom - round(_GROUND * (bottom - high))
    return (int(foot[0]) if foot.size else top), bottom
