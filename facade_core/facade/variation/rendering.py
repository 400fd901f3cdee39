"""Paint a facade's elements from its photo at the places of other elements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, partial

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Int32Array, Int64Array, IntArray, UInt8Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.facade.variation.contents import ElementGroup
from facade_core.facade.variation.element_types import fill_unknown_from_similar
from facade_core.facade.variation.patches import PATCH_MARGIN_PX, box_mask, crop_box, cut_patches, patch_size

# Percentile of a patch's values that measures its brightest part.
BRIGHTEST_PERCENTILE = 99
# Largest share of pixels that differ in visibility between two elements hidden alike.
MAX_VISIBILITY_DIFFERENCE = 0.05


def element_boxes(groups: Sequence[ElementGroup]) -> IntArray:
    """Return the (N, 4) int32 boxes of all elements in the order of their numbers."""
    return np.concatenate([g.boxes for g in groups]) if groups else np.zeros((0, 4), np.int32)


def element_types(groups: Sequence[ElementGroup]) -> Int32Array:
    """Return the (N,) int32 types of all elements in the photo in the order of their numbers."""
    return np.concatenate([g.types for g in groups]) if groups else np.zeros(0, np.int32)


def paint_photo_elements(
    canvas: UInt8Array,
    photo: UInt8Array,
    groups: Sequence[ElementGroup],
    places: Int64Array,
    boxes: IntArray,
    shown: Int64Array,
) -> UInt8Array:
    """Paint elements of the photo into boxes of a canvas, in the light of the replaced elements.

    Where the canvas is the photo, elements that stay in place keep their pixels and cover what is painted behind
    them. If two elements are hidden alike, such as windows behind one railing, the element is painted with its
    occluder.

    Parameters
    ----------
    canvas : (H', W', 3) uint8.
    photo : (H, W, 3) uint8.
    groups : elements by label and size.
    places : (M,) int element whose place each box is.
    boxes : (M, 4) int.
    shown : (M,) int element to paint, of the same group as its place.

    Returns
    -------
    (H', W', 3) uint8.
    """
    painted = canvas.astype(np.float32)
    changed = np.full(canvas.shape[:2], canvas is not photo)
    for group, first in order_by_depth(groups):
        here = np.flatnonzero((places >= first) & (places < first + len(group.boxes)))
        if not ((places[here] != shown[here]).any() or changed.any()):
            continue
        patches, seen, brightest = _visible_patches(photo, group, groups)
        fill = cache(partial(_fill_hidden_pixels, patches, seen, group))  # few walls need it
        for i in here.tolist():
            own, other = int(places[i]) - first, int(shown[i]) - first
            x0, y0, x1, y1 = boxes[i].tolist()
            within = np.s_[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)]
            if own == other and not changed[within].any():
                continue
            # A different wall around an element looks like different light and would overexpose white frames, so no element
            # becomes brighter than the one it replaces.
            most = max(1.0, float(brightest[own] / brightest[other]))
            lit = np.float32(min(group.light[own] / group.light[other], most))
            alike = (seen[own] != seen[other]).mean() <= MAX_VISIBILITY_DIFFERENCE
            patch = crop_box(photo, group.boxes[other]) if alike or seen[other].all() else fill()[other]
            fade_patch(painted, patch * lit, (x0, y0, x1, y1))
            changed[within] |= not alike or changed[within].any()
    return np.clip(np.rint(painted, out=painted), 0, 255, out=painted).astype(np.uint8)


def _visible_patches(
    photo: UInt8Array, group: ElementGroup, groups: Sequence[ElementGroup]
) -> tuple[Float32Array, BoolArray, Float32Array]:
    """Return a group's patches, their visible pixels, and their brightest value.

    Returns
    -------
    (N, h, w, 3) float32 with margin, (N, h, w) bool and (N,).
    """
    size = patch_size(group.boxes)
    patches = cut_patches(photo, group.boxes, size)
    brightest = np.maximum(1, np.percentile(patches, BRIGHTEST_PERCENTILE, axis=(1, 2, 3)))
    front = [g.boxes for g in groups if drawing_depth(g.label) > drawing_depth(group.label)]
    if not front:
        return patches, np.ones(patches.shape[:3], bool), brightest
    in_front = box_mask(np.concatenate(front), photo.shape[:2]).astype(np.float32)
    seen = cut_patches(in_front, group.boxes, size) < 0.5
    return patches, seen, brightest


def _fill_hidden_pixels(patches: Float32Array, seen: BoolArray, group: ElementGroup) -> Float32Array:
    """Fill the hidden pixels of a group's patches from similar ones in the same light."""
    light = group.light[:, None, None, None].astype(np.float32)
    return fill_unknown_from_similar(patches / light, seen) * light


def drawing_depth(label: str) -> int:
    """Return the drawing order of a label: balconies are in front of windows."""
    return ELEMENT_CLASSES.index(label) if label in ELEMENT_CLASSES else -1


def order_by_depth(groups: Sequence[ElementGroup]) -> Iterator[tuple[ElementGroup, int]]:
    """Yield the groups from back to front, with the number of their first element."""
    first = np.cumsum([0, *(len(g.boxes) for g in groups)])
    for k in np.argsort([drawing_depth(g.label) for g in groups], kind="stable"):
        yield groups[k], int(first[k])


def fade_patch(canvas: Float32Array, patch: Float32Array, box: Sequence[int]) -> None:
    """Resize a patch with margin to a box with margin and fade it into the canvas, in place.

    Parameters
    ----------
    canvas : (H, W, 3) float32; changed in place.
    patch : (h, w, 3) float32.
    box : x0, y0, x1, y1 in pixels, without the margin.
    """
    import cv2

    height, width = canvas.shape[:2]
    x0, y0, x1, y1 = (
        box[0] - PATCH_MARGIN_PX,
        box[1] - PATCH_MARGIN_PX,
        box[2] + PATCH_MARGIN_PX,
        box[3] + PATCH_MARGIN_PX,
    )
    alpha = np.minimum.outer(_fade_ramp(y1 - y0), _fade_ramp(x1 - x0))[..., None]
    inside = np.s_[max(0, -y0) : height - y0, max(0, -x0) : width - x0]
    target = canvas[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)]
    pixels = cv2.resize(np.ascontiguousarray(patch), (x1 - x0, y1 - y0), interpolation=cv2.INTER_LINEAR)
    target += alpha[inside] * (pixels[inside] - target)


def _fade_ramp(length: int) -> Float32Array:
    """Return (length,) float32: 1 inside, falling towards 0 over the margin at both ends."""
    at = np.arange(length)
    return np.minimum(1, (1 + np.minimum(at, at[::-1])) / (PATCH_MARGIN_PX + 1)).astype(np.float32)
