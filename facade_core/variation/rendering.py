"""Painting a facade's coded elements on its wall."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from facade_core.labels import ELEMENT_CLASSES
from facade_core.variation.contents import Group
from facade_core.variation.patches import MARGIN


def element_boxes(groups: Sequence[Group]) -> np.ndarray:
    """(N, 4) int32 boxes of all elements in the order of their numbers."""
    return np.concatenate([g.boxes for g in groups]) if groups else np.zeros((0, 4), np.int32)


def element_types(groups: Sequence[Group]) -> np.ndarray:
    """(N,) int32 types of all elements in the photo in the order of their numbers."""
    return np.concatenate([g.types for g in groups]) if groups else np.zeros(0, np.int32)


def paint_elements(
    wall: np.ndarray, groups: Sequence[Group], places: np.ndarray, boxes: np.ndarray, shown: np.ndarray
) -> np.ndarray:
    """(H, W, 3) uint8: the wall with element shown[i] in boxes[i], in the light of element places[i].

    places, shown (M,) int: numbers of elements of one group each; boxes (M, 4) int.
    """
    canvas = wall.astype(np.float32)
    for group, first in back_to_front(groups):
        here = np.flatnonzero((places >= first) & (places < first + len(group.boxes)))
        patches = group.basis.patches(group.coordinates[shown[here] - first])
        patches *= group.light[places[here] - first, None, None, None].astype(np.float32)
        for box, patch in zip(boxes[here].tolist(), patches, strict=True):
            blend(canvas, patch, box)
    return np.clip(canvas.round(), 0, 255).astype(np.uint8)


def back_to_front(groups: Sequence[Group]) -> Iterator[tuple[Group, int]]:
    """The groups with the number of their first element, class by class: balconies stand before windows."""
    first = np.cumsum([0, *(len(g.boxes) for g in groups)])
    depth = [ELEMENT_CLASSES.index(g.label) if g.label in ELEMENT_CLASSES else -1 for g in groups]
    for k in np.argsort(depth, kind="stable"):
        yield groups[k], int(first[k])


def blend(canvas: np.ndarray, patch: np.ndarray, box: Sequence[int]) -> None:
    """Resize a patch (h, w, 3) float32, which carries the margin, to a box and its margin and fade it into the canvas."""
    import cv2

    height, width = canvas.shape[:2]
    x0, y0, x1, y1 = box[0] - MARGIN, box[1] - MARGIN, box[2] + MARGIN, box[3] + MARGIN
    alpha = np.minimum.outer(_ramp(y1 - y0), _ramp(x1 - x0))[..., None]
    inside = np.s_[max(0, -y0) : height - y0, max(0, -x0) : width - x0]
    target = canvas[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)]
    pixels = cv2.resize(np.ascontiguousarray(patch), (x1 - x0, y1 - y0), interpolation=cv2.INTER_LINEAR)
    target += alpha[inside] * (pixels[inside] - target)


def _ramp(length: int) -> np.ndarray:
    """(length,) float32: 1 inside, falling towards 0 over the margin at both ends."""
    at = np.arange(length)
    return np.minimum(1, (1 + np.minimum(at, at[::-1])) / (MARGIN + 1)).astype(np.float32)
