"""Complete windows that a hole cuts, each from one wholly visible window."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.types import Element
from facade_core.facade.layout.grids import group_by_size
from facade_core.facade.texture.settings import COMPLETION

# Labels whose elements are completed from one source.
COMPLETED_LABELS = ("window", "balcony")

_Box = tuple[int, int, int, int]


def complete_windows(image: UInt8Array, mask: BoolArray, elements: Sequence[Element]) -> UInt8Array:
    """Copy the hidden part of each window and balcony from the most similar visible one of its size.

    Inpainting chooses pixel by pixel, so that a window may come from three others and its bars do not meet. An
    element without a similar visible one stays; pixels outside the mask keep their bits.

    Parameters
    ----------
    image : (H, W, 3) uint8 with inpainted pixels.
    mask : (H, W) bool inpainted pixels.
    elements : elements in pixels.

    Returns
    -------
    (H, W, 3) uint8.
    """
    result = image.copy()
    for members in group_by_size(elements):
        own = [elements[i] for i in members.tolist()]
        if own[0].label not in COMPLETED_LABELS:
            continue
        boxes = [framed_box(element, mask.shape) for element in own]
        hidden = [bool(mask[y0:y1, x0:x1].any()) for x0, y0, x1, y1 in boxes]
        seen = [box for box, cut in zip(boxes, hidden, strict=True) if not cut]
        usual = _typical_difference(image, seen)
        for box in (_align_box(box, seen) for box, cut in zip(boxes, hidden, strict=True) if cut):
            found = _find_source(image, mask, box, seen)
            if found is None or found[0] > COMPLETION.max_difference_ratio * usual:
                continue
            fitted = _refine_shift(image, mask, box, found[1], found[2])
            if fitted is not None:
                _copy_source(mask, image, result, box, *fitted)
    return result


def framed_box(element: Element, shape: tuple[int, ...]) -> _Box:
    """Return x0, y0, x1, y1 of an element with its frame, within the image."""
    x, y = COMPLETION.frame_share * element.width, COMPLETION.frame_share * element.height
    x0, y0 = max(0, round(element.x0 - x)), max(0, round(element.y0 - y))
    return x0, y0, max(x0 + 1, min(shape[1], round(element.x1 + x))), max(y0 + 1, min(shape[0], round(element.y1 + y)))


def _align_box(box: _Box, seen: list[_Box]) -> _Box:
    """Move a box to the rows and columns of the visible ones, if it is near to one."""
    moved = list(box)
    for low, high in ((0, 2), (1, 3)):
        middles = np.array([(other[low] + other[high]) / 2 for other in seen])
        offset = middles - (box[low] + box[high]) / 2
        near = offset[np.abs(offset) < COMPLETION.aligned_share * (box[high] - box[low])]
        step = round(float(np.median(near))) if len(near) else 0
        if box[low] + step >= 0:
            moved[low], moved[high] = box[low] + step, box[high] + step
    return moved[0], moved[1], moved[2], moved[3]


def _typical_difference(image: UInt8Array, seen: list[_Box]) -> float:
    """Return the median difference of visible boxes to their most similar other; 0 for fewer than two."""
    nothing = np.zeros(image.shape[:2], bool)
    found = [_find_source(image, nothing, box, seen[:i] + seen[i + 1 :]) for i, box in enumerate(seen)]
    differences = [source[0] for source in found if source is not None]
    return float(np.median(differences)) if differences else 0.0


def _find_source(image: UInt8Array, mask: BoolArray, box: _Box, seen: list[_Box]) -> tuple[float, int, int] | None:
    """Find the most similar visible box of similar size.

    Returns its difference, larger in other rows, and its offset right and down.
    """
    x0, y0, x1, y1 = box
    sides = np.array([x1 - x0, y1 - y0])
    best: tuple[float, int, int] | None = None
    for u0, v0, u1, v1 in seen:
        if (
            np.abs([u1 - u0, v1 - v0] - sides)
            <= np.maximum(COMPLETION.max_side_difference_px, COMPLETION.max_side_difference * sides)
        ).all():
            right, down = (u0 + u1 - x0 - x1) // 2, (v0 + v1 - y0 - y1) // 2
            difference = _shift_difference(image, mask, box, right, down)
            if difference is not None and abs(down) > COMPLETION.aligned_share * sides[1]:
                difference *= COMPLETION.other_row_factor
            if difference is not None and (best is None or difference < best[0]):
                best = difference, right, down
    return best


def _refine_shift(image: UInt8Array, mask: BoolArray, box: _Box, right: int, down: int) -> tuple[int, int] | None:
    """Refine an offset to the least difference, with a small penalty on the change."""
    candidates = []
    for y in range(-COMPLETION.max_refinement_px, COMPLETION.max_refinement_px + 1):
        for x in range(-COMPLETION.max_refinement_px, COMPLETION.max_refinement_px + 1):
            difference = _shift_difference(image, mask, box, right + x, down + y)
            if difference is not None:
                candidates.append(
                    (difference * (1 + COMPLETION.shift_penalty * (abs(x) + abs(y))), (right + x, down + y))
                )
    return min(candidates)[1] if candidates else None


def _shift_difference(image: UInt8Array, mask: BoolArray, box: _Box, right: int, down: int) -> float | None:
    """Return the mean difference of a box and its shifted copy; None beyond the image or where that is hidden."""
    x0, y0, x1, y1 = box
    if min(x0 + right, y0 + down) < 0 or x1 + right > image.shape[1] or y1 + down > image.shape[0]:
        return None
    if x1 > image.shape[1] or y1 > image.shape[0] or mask[y0 + down : y1 + down, x0 + right : x1 + right].any():
        return None
    step = COMPLETION.sample_step_px
    own = image[y0:y1:step, x0:x1:step].astype(np.int16)
    apart = np.abs(own - image[y0 + down : y1 + down : step, x0 + right : x1 + right : step])
    weight = np.where(mask[y0:y1:step, x0:x1:step], np.float32(COMPLETION.inpainted_weight), np.float32(1))
    # a sum of three planes takes a tenth of a mean over the last axis
    return float(np.average((apart[..., 0] + apart[..., 1] + apart[..., 2]) / 3, weights=weight))


def _copy_source(mask: BoolArray, image: UInt8Array, result: UInt8Array, box: _Box, right: int, down: int) -> None:
    """Copy the shifted picture into the hidden pixels of a box of the result; it fades at the box's edges."""
    x0, y0, x1, y1 = box
    across, along = (np.minimum(np.arange(n) + 1, n - np.arange(n)) for n in (x1 - x0, y1 - y0))
    share = np.clip(np.minimum(across[None], along[:, None]) / (COMPLETION.fade_px + 1), 0, 1)[..., None]
    new = image[y0 + down : y1 + down, x0 + right : x1 + right]
    mixed = np.rint(share * new + (1 - share) * result[y0:y1, x0:x1]).astype(np.uint8)
    result[y0:y1, x0:x1] = np.where(mask[y0:y1, x0:x1, None], mixed, result[y0:y1, x0:x1])
