"""Windows that a hole cuts, of one piece: what is hidden of each is shown as one window that is seen whole shows it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.types import Element
from facade_core.facade.layout.grids import group_by_size

# What is made of one piece.
COMPLETED_LABELS = ("window", "balcony")
# Sides that differ by no more, as a share and in pixels, are the same; and how far a copy is moved to fit, pixels.
MAX_SIDE_DIFFERENCE, MAX_SIDE_DIFFERENCE_PX, MAX_REFINEMENT_PX = 0.15, 3, 3
# What a pixel of that costs, as a share of the difference that is left.
SHIFT_PENALTY = 0.05
# An element whose middle is within this share of its side of a row's or a column's is on it.
ALIGNED_SHARE = 0.35
# One of another row differs by so many times as much: it has another head and sill.
OTHER_ROW_FACTOR = 1.5
# Around an element its frame and sill go with it, as a share of its side; over so many pixels it fades into what is beside it.
FRAME_SHARE, FADE_PX = 0.12, 3
# Where what is there differs from all that are seen by more than this times what those differ by, it is something else.
MAX_DIFFERENCE_RATIO = 4.0
# What was made counts so much beside what is seen; only every so many pixels are compared.
INPAINTED_WEIGHT, SAMPLE_STEP_PX = 0.3, 2

_Box = tuple[int, int, int, int]


def complete_windows(image: np.ndarray, mask: np.ndarray, elements: Sequence[Element]) -> np.ndarray:
    """An image (H, W, 3) uint8 whose pixels of mask (H, W) bool were made anew, each window and balcony there of one piece.

    What was made anew is chosen pixel by pixel, so that a window may be of three others, and its bars do not meet. Of each
    element (pixels) that is hidden in part or wholly, all that is hidden is copied from the one of its size, seen whole, that
    is most like what is there, seen or made. Where none is, it stays. Other pixels keep their bits.
    """
    result = image.copy()
    for members in group_by_size(elements):
        own = [elements[i] for i in members.tolist()]
        if own[0].label not in COMPLETED_LABELS:
            continue
        boxes = [_framed_box(element, mask.shape) for element in own]
        hidden = [bool(mask[y0:y1, x0:x1].any()) for x0, y0, x1, y1 in boxes]
        seen = [box for box, cut in zip(boxes, hidden, strict=True) if not cut]
        usual = _typical_difference(image, seen)
        for box in (_align_box(box, seen) for box, cut in zip(boxes, hidden, strict=True) if cut):
            found = _find_source(image, mask, box, seen)
            if found is None or found[0] > MAX_DIFFERENCE_RATIO * usual:
                continue
            fitted = _refine_shift(image, mask, box, found[1], found[2])
            if fitted is not None:
                _copy_source(mask, image, result, box, *fitted)
    return result


def _framed_box(element: Element, shape: tuple[int, ...]) -> _Box:
    """x0, y0, x1, y1 of an element and what is around it, on the image."""
    x, y = FRAME_SHARE * element.width, FRAME_SHARE * element.height
    x0, y0 = max(0, round(element.x0 - x)), max(0, round(element.y0 - y))
    return x0, y0, max(x0 + 1, min(shape[1], round(element.x1 + x))), max(y0 + 1, min(shape[0], round(element.y1 + y)))


def _align_box(box: _Box, seen: list[_Box]) -> _Box:
    """A box where the rows and columns of those seen are, if it is near to one."""
    moved = list(box)
    for low, high in ((0, 2), (1, 3)):
        middles = np.array([(other[low] + other[high]) / 2 for other in seen])
        offset = middles - (box[low] + box[high]) / 2
        near = offset[np.abs(offset) < ALIGNED_SHARE * (box[high] - box[low])]
        step = round(float(np.median(near))) if len(near) else 0
        if box[low] + step >= 0:
            moved[low], moved[high] = box[low] + step, box[high] + step
    return moved[0], moved[1], moved[2], moved[3]


def _typical_difference(image: np.ndarray, seen: list[_Box]) -> float:
    """How far those seen are from the most like of the others, the median; 0 where there are not two."""
    nothing = np.zeros(image.shape[:2], bool)
    found = [_find_source(image, nothing, box, seen[:i] + seen[i + 1 :]) for i, box in enumerate(seen)]
    told = [one[0] for one in found if one is not None]
    return float(np.median(told)) if told else 0.0


def _find_source(image: np.ndarray, mask: np.ndarray, box: _Box, seen: list[_Box]) -> tuple[float, int, int] | None:
    """Of those seen, of the size of a box, the one most like it: the mean difference, more from another row, and how far to
    the right and down it lies."""
    x0, y0, x1, y1 = box
    sides = np.array([x1 - x0, y1 - y0])
    best: tuple[float, int, int] | None = None
    for u0, v0, u1, v1 in seen:
        if (
            np.abs([u1 - u0, v1 - v0] - sides) <= np.maximum(MAX_SIDE_DIFFERENCE_PX, MAX_SIDE_DIFFERENCE * sides)
        ).all():
            right, down = (u0 + u1 - x0 - x1) // 2, (v0 + v1 - y0 - y1) // 2
            unlike = _shift_difference(image, mask, box, right, down)
            if unlike is not None and abs(down) > ALIGNED_SHARE * sides[1]:
                unlike *= OTHER_ROW_FACTOR
            if unlike is not None and (best is None or unlike < best[0]):
                best = unlike, right, down
    return best


def _refine_shift(image: np.ndarray, mask: np.ndarray, box: _Box, right: int, down: int) -> tuple[int, int] | None:
    """So far to the right and down, moved to where what lies there is most like a box, not gladly far."""
    told = []
    for y in range(-MAX_REFINEMENT_PX, MAX_REFINEMENT_PX + 1):
        for x in range(-MAX_REFINEMENT_PX, MAX_REFINEMENT_PX + 1):
            unlike = _shift_difference(image, mask, box, right + x, down + y)
            if unlike is not None:
                told.append((unlike * (1 + SHIFT_PENALTY * (abs(x) + abs(y))), (right + x, down + y)))
    return min(told)[1] if told else None


def _shift_difference(image: np.ndarray, mask: np.ndarray, box: _Box, right: int, down: int) -> float | None:
    """The mean difference between a box and what lies so far to the right and down of it; None beyond the image, or where
    that is hidden too."""
    x0, y0, x1, y1 = box
    if min(x0 + right, y0 + down) < 0 or x1 + right > image.shape[1] or y1 + down > image.shape[0]:
        return None
    if x1 > image.shape[1] or y1 > image.shape[0] or mask[y0 + down : y1 + down, x0 + right : x1 + right].any():
        return None
    own = image[y0:y1:SAMPLE_STEP_PX, x0:x1:SAMPLE_STEP_PX].astype(np.int16)
    other = image[y0 + down : y1 + down : SAMPLE_STEP_PX, x0 + right : x1 + right : SAMPLE_STEP_PX]
    weight = np.where(mask[y0:y1:SAMPLE_STEP_PX, x0:x1:SAMPLE_STEP_PX], np.float32(INPAINTED_WEIGHT), np.float32(1))
    return float(np.average(np.abs(own - other).mean(axis=2), weights=weight))


def _copy_source(mask: np.ndarray, image: np.ndarray, result: np.ndarray, box: _Box, right: int, down: int) -> None:
    """Show in a box of the result, where it is hidden, what lies so far to the right and down; it fades at the box's edges."""
    x0, y0, x1, y1 = box
    across, along = (np.minimum(np.arange(n) + 1, n - np.arange(n)) for n in (x1 - x0, y1 - y0))
    share = np.clip(np.minimum(across[None], along[:, None]) / (FADE_PX + 1), 0, 1)[..., None]
    new = image[y0 + down : y1 + down, x0 + right : x1 + right]
    mixed = np.rint(share * new + (1 - share) * result[y0:y1, x0:x1]).astype(np.uint8)
    result[y0:y1, x0:x1] = np.where(mask[y0:y1, x0:x1, None], mixed, result[y0:y1, x0:x1])
