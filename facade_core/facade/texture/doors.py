"""Pictures of doors: plain ones, and those of exemplars whose feet are hidden."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import ENTRANCES

# Colours of door leaves.
LEAF_COLOURS = np.array(
    [[78, 70, 62], [92, 90, 86], [62, 74, 68], [98, 74, 58], [74, 80, 90], [112, 106, 96], [70, 56, 48]], np.float64
)


def paint_door(
    image: UInt8Array, labels: UInt8Array, middle: float, metres_per_pixel: float, rng: np.random.Generator
) -> None:
    """Paint a plain door at the foot of a wall, in place.

    Parameters
    ----------
    image : (h, w, 3) uint8; changed in place.
    labels : (h, w) uint8; changed in place.
    middle : centre of the door, metres from the left.
    metres_per_pixel : scale of `image`.
    rng : draws the door.
    """
    wide, high = (max(2, round(side / metres_per_pixel)) for side in ENTRANCES.door_size_m)
    left = round(middle / metres_per_pixel - wide / 2)
    left, wide = max(0, left), min(wide, labels.shape[1])
    top = max(0, len(labels) - high)
    fill_with_door(image, labels, (slice(top, len(labels)), slice(left, left + wide)), metres_per_pixel, rng)


def fill_with_door(
    image: UInt8Array,
    labels: UInt8Array,
    at: tuple[slice, slice],
    metres_per_pixel: float,
    rng: np.random.Generator,
) -> None:
    """Fill some rows and columns of a wall with a plain door, in place; parameters as of `paint_door`."""
    beside = image[at[0]][labels[at[0]] == FacadeClass.WALL]
    light = (beside if len(beside) else image[at]).mean() / 150.0  # a door in a dark picture is dark
    (high, wide), leaves = labels[at].shape, 1 + int(labels[at].shape[1] * metres_per_pixel > ENTRANCES.max_leaf_m)
    leaf = draw_plain_door((high, -(-wide // leaves)), metres_per_pixel, rng)
    door = np.hstack([leaf, leaf[:, ::-1]])[:, :wide]
    image[at] = np.clip(np.rint(door * np.clip(light, 0.6, 1.15)), 0, 255).astype(np.uint8)
    labels[at] = FacadeClass.DOOR


def lengthen_doors(
    image: UInt8Array, labels: UInt8Array, hidden: BoolArray, metres_per_pixel: float
) -> tuple[UInt8Array, UInt8Array]:
    """Stretch the visible part of each door, with the wall beside it, over its hidden foot; paint a door that is mostly hidden.

    Parameters
    ----------
    image : (h, w, 3) uint8, completed.
    labels : (h, w) uint8 class ids, completed.
    hidden : (h, w) bool, inpainted pixels.
    metres_per_pixel : scale of the picture.
    """
    image, labels = image.copy(), labels.copy()
    parts, _ = ndimage.label(labels == FacadeClass.DOOR)
    reach = round(ENTRANCES.door_margin_m / metres_per_pixel)
    for number, (rows, columns) in enumerate(ndimage.find_objects(parts), start=1):
        is_door = parts[rows, columns] == number
        seen = np.flatnonzero((is_door & ~hidden[rows, columns]).sum(axis=1) >= 0.5 * is_door.sum(axis=1))
        shown = int(seen[-1]) + 1 if len(seen) else 0
        is_small = is_door.sum() * metres_per_pixel**2 < ENTRANCES.min_door_m2
        if is_small or shown == len(is_door) or is_door.mean() < ENTRANCES.min_door_fill:
            continue
        if shown < ENTRANCES.min_door_seen * len(is_door):
            rng = np.random.default_rng(int(is_door.sum()))
            fill_with_door(image, labels, (rows, columns), metres_per_pixel, rng)
            continue
        is_wall = (labels[rows] == FacadeClass.WALL).all(axis=0)
        left, right = (
            is_wall[max(0, columns.start - reach) : columns.start],
            is_wall[columns.stop : columns.stop + reach],
        )
        wide = slice(columns.start - int(left[::-1].cumprod().sum()), columns.stop + int(right.cumprod().sum()))
        upper = slice(rows.start, rows.start + shown)
        size = image[rows, wide].shape[1::-1]
        image[rows, wide] = cv2.resize(image[upper, wide], size, interpolation=cv2.INTER_LINEAR)
        labels[rows, wide] = cv2.resize(labels[upper, wide], size, interpolation=cv2.INTER_NEAREST)
    return image, labels


def draw_plain_door(shape: tuple[int, int], metres_per_pixel: float, rng: np.random.Generator) -> Float64Array:
    """Draw a back door: a leaf of planks or panels, some with a pane, in a frame.

    Parameters
    ----------
    shape : (h, w) pixels.
    metres_per_pixel : scale.
    rng : draws colours and kind.

    Returns
    -------
    (h, w, 3) float.
    """
    height, width = shape
    y, x = ((np.arange(n) + 0.5) * metres_per_pixel for n in (height, width))
    across, down = x[None, :], y[:, None]
    wide, high = width * metres_per_pixel, height * metres_per_pixel
    colour, frame = LEAF_COLOURS[rng.integers(len(LEAF_COLOURS))], ENTRANCES.frame_gains[int(rng.random() < 0.6)]
    tone = np.ones(shape) * (1 - 0.1 * down / high) * (1 + 0.05 * rng.standard_normal((1, width)))
    glazed, planked = rng.random() < ENTRANCES.glazed_probability, rng.random() < ENTRANCES.planked_probability
    inner = (ENTRANCES.frame_m + ENTRANCES.rail_m, wide - ENTRANCES.frame_m - ENTRANCES.rail_m)

    def is_in_groove(left: float, right: float, upper: float, lower: float) -> BoolArray:
        side_distance = np.minimum(np.abs(across - left), np.abs(across - right))
        over = np.minimum(np.abs(down - upper), np.abs(down - lower))
        within = (
            (across > left - ENTRANCES.groove_m)
            & (across < right + ENTRANCES.groove_m)
            & (down > upper - ENTRANCES.groove_m)
            & (down < lower + ENTRANCES.groove_m)
        )
        found: BoolArray = within & (np.minimum(side_distance, over) < ENTRANCES.groove_m)
        return found

    parts = [(0.18 * high, 0.5 * high), (0.58 * high, 0.92 * high)]
    if planked:
        tone *= np.where((across - ENTRANCES.frame_m) % ENTRANCES.plank_m < ENTRANCES.groove_m, 0.7, 1.0)
    else:
        for upper, lower in parts:
            tone *= np.where(is_in_groove(*inner, upper, lower), 0.68, 1.0)
    door: Float64Array = tone[..., None] * colour
    if glazed:
        (upper, lower) = parts[0]
        pane = (across > inner[0]) & (across < inner[1]) & (down > upper) & (down < lower)
        door[pane] = (
            ENTRANCES.pane_light
            * np.array([0.95, 1.0, 1.06])
            * (1 + 0.3 * (1 - np.broadcast_to(down, shape)[pane] / high))[:, None]
        )
    around = (across < ENTRANCES.frame_m) | (across > wide - ENTRANCES.frame_m) | (down < ENTRANCES.frame_m)
    door[around] = np.minimum(colour * frame, 210) * (0.9 + 0.2 * tone[around][:, None] / 2)
    # shadow of the frame on the leaf, and the handle
    leaf = ~around & (down < ENTRANCES.frame_m + 0.05)
    door[leaf] *= 0.7
    knob = (np.abs(across - (wide - ENTRANCES.frame_m - 0.07)) < 0.025) & (np.abs(down - 0.52 * high) < 0.05)
    door[np.broadcast_to(knob, shape)] = 165
    return door
