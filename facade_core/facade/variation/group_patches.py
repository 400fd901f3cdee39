"""Patches of a facade's elements by label and comparable size, as types are found from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, IntArray, UInt8Array
from facade_core.core.types import Element
from facade_core.facade.layout.grids import box_array, group_by_size
from facade_core.facade.variation.element_types import fill_unknown_from_similar
from facade_core.facade.variation.patches import (
    align_boxes,
    box_mask,
    cut_patches,
    patch_size,
    relative_wall_brightness,
    wall_integral_images,
)
from facade_core.facade.variation.rendering import drawing_depth


class GroupPatches(NamedTuple):
    """Patches of the elements of one label and comparable size.

    Attributes
    ----------
    members : (N,) index of each element.
    boxes : (N, 4) int32 pixels, aligned within the group.
    light : (N,) relative brightness of the wall around each element.
    wall : brightness of the wall where its relative brightness is 1.
    patches : (N, h, w, 3) with light removed and hidden pixels filled from similar patches.
    seen : (N, h, w) bool, False where another element hides the patch.
    """

    members: Int64Array
    boxes: IntArray
    light: Float64Array
    wall: float
    patches: Float32Array
    seen: BoolArray


def cut_group_patches(image: UInt8Array, elements: Sequence[Element]) -> Iterator[GroupPatches]:
    """Cut the patches of each group of `group_by_size`.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    elements : in whole pixels, inside the image.
    """
    all_boxes = box_array(elements).astype(np.int32)
    sums = wall_integral_images(image, box_mask(all_boxes, image.shape[:2]))
    depth = np.array([drawing_depth(e.label) for e in elements], int)
    for members in group_by_size(elements):
        size = patch_size(all_boxes[members])
        boxes = align_boxes(image, all_boxes[members], size)
        light, wall = relative_wall_brightness(sums, all_boxes[members])
        patches = np.asarray(
            cut_patches(image, boxes, size) / light[:, None, None, None].astype(np.float32), np.float32
        )
        in_front = box_mask(all_boxes[depth > depth[members[0]]], image.shape[:2])
        seen = cut_patches(in_front.astype(np.float32), boxes, size) < 0.5
        yield GroupPatches(members, boxes, light, wall, fill_unknown_from_similar(patches, seen), seen)
