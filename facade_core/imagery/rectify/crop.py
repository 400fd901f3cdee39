"""Crop of a facade picture to the facade, without sky, street and neighbours."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.types import Box
from facade_core.imagery.rectify.settings import CROP
from facade_core.parsing.segmentation import Segmentation
from facade_core.parsing.segmenter import ParserModel, facade_surroundings_mask

# Share of the height (turned: of the width) up to which a run from the top, the right and the left is beyond the wall.
MAX_BEYOND_SHARE = {0: 0.5, 1: 0.25, 3: 0.25}


@dataclass(frozen=True, slots=True, eq=False)
class FacadeCrop:
    """Part of a picture that shows the facade.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool, pixels that do not show the facade.
    outside : (h, w) bool, sky, street or neighbours at the borders.
    box : x0, y0, x1, y1 of the part in the picture, half-open.
    has_facade : False if no facade was found; the picture then stays whole.
    notes : what was left out, in words.
    kept : share of the picture.
    homography : (3, 3) from pixels of the photo to those of the picture.
    segmentation : segmentation of the part, out of that of the picture; None of a picture that is all hidden.
    """

    image: UInt8Array
    hidden: BoolArray
    outside: BoolArray
    box: Box
    has_facade: bool = True
    notes: tuple[str, ...] = ()
    kept: float = 1.0
    homography: Float64Array = field(default_factory=lambda: np.eye(3))
    segmentation: Segmentation | None = None

    @property
    def corners(self) -> Float64Array:
        """Return the corners (4, 2) in the photo, x and y in pixels, clockwise from the upper left."""
        x0, y0, x1, y1 = self.box
        corners = np.array([[x0, y0, 1], [x1, y0, 1], [x1, y1, 1], [x0, y1, 1]]) @ np.linalg.inv(self.homography).T
        return np.asarray(corners[:, :2] / corners[:, 2:])


def crop_to_box(image: UInt8Array, hidden: BoolArray, outside: BoolArray, box: Box | None) -> FacadeCrop:
    """Crop a picture to the box of its facade; None if it shows none: the picture then stays whole."""
    if box is None:
        height, width = hidden.shape
        return FacadeCrop(image, hidden, np.zeros_like(hidden), (0, 0, width, height), has_facade=False)
    x0, y0, x1, y1 = box
    part = np.s_[y0:y1, x0:x1]
    return FacadeCrop(image[part], hidden[part], _touching_border(outside[part]), box)


def wall_surroundings_mask(image: UInt8Array, hidden: BoolArray, *, model: ParserModel = None) -> BoolArray:
    """Mask the street below the foot of a wall in a posed panorama, and sky and neighbours beyond its top and sides.

    Heights of models, cameras and the ground are rarely exact to the metre. The parser alone is no proof: a bare wall
    resembles a neighbour, and sky resembles plaster. Beyond top and sides a run of such pixels from the border inwards
    counts only if it ends at a step of brightness, as the skyline is. Clear sky from the top down beside the wall counts by
    its shape, with what is beyond it.

    Parameters
    ----------
    image : (h, w, 3) uint8, the rectified wall.
    hidden : (h, w) bool, pixels that do not show the wall.
    model : as in `parse`.

    Returns
    -------
    (h, w) bool.
    """
    if hidden.all():
        return np.zeros_like(hidden)
    outside = facade_surroundings_mask(image, hidden, model=model) & ~hidden
    found = _street_below_wall(outside, hidden)
    grey = image.mean(axis=2)
    for turns, beyond in product((0, 1, 3), (outside, _looks_like_sky(image) & ~hidden)):
        # so turned that the top, the right and the left are the first rows
        own, unseen = np.rot90(beyond, turns), np.rot90(hidden, turns)
        beyond_step = _beyond_skyline(own, unseen, np.rot90(grey, turns), MAX_BEYOND_SHARE[turns])
        found |= np.rot90(_beyond_upright_edge(beyond_step, own, unseen) if turns else beyond_step, -turns)
    found |= _clear_sky_beside_wall(image, hidden)
    return found & ~hidden


def _clear_sky_beside_wall(image: UInt8Array, hidden: BoolArray) -> BoolArray:
    """Mask blue sky that reaches down from the top near a side of a wall, and what is between it and that side."""
    import cv2

    height, width = hidden.shape
    sky = (_is_blue(image) & ~hidden).astype(np.uint8)
    found = np.zeros_like(hidden)
    count, parts, boxes, _ = cv2.connectedComponentsWithStats(sky, connectivity=8)
    for part in range(1, count):
        left, top, wide, high = boxes[part, :4]
        if (
            top > CROP.sky_rim_share * height
            or high < CROP.min_sky_height_share * height
            or wide > CROP.max_sky_width_share * width
        ):
            continue
        is_sky = cv2.dilate((parts == part).astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
        if left <= CROP.sky_rim_share * width:
            found |= _outside_edge(is_sky[:, ::-1])[:, ::-1]
        if width - left - wide <= CROP.sky_rim_share * width:
            found |= _outside_edge(is_sky)
    return found


def _outside_edge(is_sky: BoolArray) -> BoolArray:
    """Mask what is right of the left edge of some sky, and below it where that edge is upright: (h, w) bool."""
    outside: BoolArray = np.logical_or.accumulate(is_sky, axis=1)
    edge = is_sky.argmax(axis=1)[is_sky.any(axis=1)]
    low, middle, high = np.quantile(edge, (0.1, 0.5, 0.9))
    if high - low <= CROP.max_edge_spread_share * is_sky.shape[1]:
        outside[:, round(float(middle)) :] = True
    return outside


def _street_below_wall(outside: BoolArray, hidden: BoolArray) -> BoolArray:
    """Mask per column the run of street from the last row up; hidden pixels do not interrupt it."""
    street = outside[::-1]
    is_run = np.logical_and.accumulate(street | hidden[::-1], axis=0)
    length = is_run.sum(axis=0)
    length[(length > CROP.max_street_share * len(street)) | ~(is_run & street).any(axis=0)] = 0
    if (length > 0).sum() < CROP.min_street_columns * (~hidden.all(axis=0)).sum():
        return np.zeros_like(hidden)
    return np.asarray((np.arange(len(street))[::-1, None] < length) & ~hidden)


def _looks_like_sky(image: UInt8Array) -> BoolArray:
    """Mask the pixels (h, w) that are as bright as an overcast sky, or bright and blue."""
    return np.asarray((image.min(axis=2) >= CROP.min_overcast_grey) | _is_blue(image))


def _is_blue(image: UInt8Array) -> BoolArray:
    red, blue = image[..., 0].astype(np.int16), image[..., 2].astype(np.int16)
    return np.asarray((blue - red >= CROP.min_blue) & (blue >= CROP.min_blue_grey))


def _beyond_skyline(outside: BoolArray, hidden: BoolArray, grey: Float64Array, max_share: float) -> BoolArray:
    """Mask per column the run of outside pixels from the first row down to a step of brightness.

    Parameters
    ----------
    outside, hidden : (h, w) bool.
    grey : (h, w) brightness.
    max_share : share of the height at which a run is the wall, taken for a neighbour.
    """
    height, width = outside.shape
    reach = max(4, round(CROP.step_reach_share * height))
    if height <= 3 * reach:
        return np.zeros_like(outside)
    is_rim = np.arange(height)[:, None] < CROP.border_rim_pixels
    is_run = np.logical_and.accumulate(outside | hidden | is_rim, axis=0)
    length = is_run.sum(axis=0)
    sums = np.concatenate([np.zeros((1, width)), np.cumsum(grey, axis=0)])
    column = np.arange(width)
    ends = np.clip(length, reach, max(reach, height - 2 * reach))  # the step itself is blurred
    above = sums[ends, column] - sums[ends - reach, column]
    below = sums[ends + 2 * reach, column] - sums[ends + reach, column]
    is_valid = (np.abs(above - below) >= CROP.min_skyline_step * reach) & (is_run & outside).any(axis=0)
    is_valid &= (length > 0) & (length <= max_share * height)
    if is_valid.sum() < CROP.min_skyline_columns * width:
        return np.zeros_like(outside)
    return np.asarray(np.arange(height)[:, None] < np.where(is_valid, length + reach, 0))


def _beyond_upright_edge(found: BoolArray, outside: BoolArray, hidden: BoolArray) -> BoolArray:
    """Extend a mask beyond one side to all columns if its edge is straight, else return it unchanged: (h, w) bool.

    Parameters
    ----------
    found : (h, w) bool, result of `_beyond_skyline`.
    outside, hidden : (h, w) bool.
    """
    height = len(found)
    length = found.sum(axis=0)
    if (length > 0).mean() < CROP.min_edge_rows:
        return found
    low, middle, high = np.quantile(length[length > 0], (0.1, 0.5, 0.9))
    past = min(height - 1, round(float(middle) + CROP.max_edge_spread_share * height) + 1)
    goes_on = (outside | hidden)[CROP.border_rim_pixels : past + 1].all(axis=0) & ~hidden[past]
    if high - low > CROP.max_edge_spread_share * height or goes_on.mean() > CROP.max_past_rows:
        return found
    return np.asarray(found | (np.arange(height)[:, None] < round(float(middle))))


def find_facade_box(outside: BoolArray, hidden: BoolArray) -> Box | None:
    """Find the box in which facade pixels outnumber outside pixels by most.

    Compares all boxes on a grid of CROP.grid_cells x CROP.grid_cells: the best run of columns (Kadane) for each pair of rows.

    Parameters
    ----------
    outside : (H, W) bool, pixels outside the facade.
    hidden : (H, W) bool, pixels that count for neither.

    Returns
    -------
    x0, y0, x1, y1; None if the box covers less than CROP.min_facade_share of the picture.
    """
    import cv2

    height, width = outside.shape
    size = (min(width, CROP.grid_cells), min(height, CROP.grid_cells))
    outside_share, hidden_share = (
        cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) / 255.0
        for mask in (outside & ~hidden, hidden)
    )
    value = (1 - hidden_share) - 2 * outside_share + CROP.hidden_value * hidden_share
    cumulative = np.concatenate([np.zeros((1, size[0])), np.cumsum(value, axis=0)])
    best, best_box = 0.0, None
    for top in range(size[1]):
        sums = np.cumsum(cumulative[top + 1 :] - cumulative[top], axis=1)
        sums = np.concatenate([np.zeros((len(sums), 1)), sums], axis=1)
        gain = sums - np.minimum.accumulate(sums, axis=1)
        bottom, right = divmod(int(gain.argmax()), gain.shape[1])
        if gain[bottom, right] > best:
            best = gain[bottom, right]
            best_box = (int(sums[bottom, : right + 1].argmin()), top, right, top + bottom + 1)
    if best_box is None:
        return None
    x0, x1 = (round(x * width / size[0]) for x in best_box[::2])
    y0, y1 = (round(y * height / size[1]) for y in best_box[1::2])
    return (x0, y0, x1, y1) if (y1 - y0) * (x1 - x0) >= CROP.min_facade_share * outside.size else None


def _touching_border(outside: BoolArray) -> BoolArray:
    """Components that touch the border: "sky" inside a facade is a pane or a gap in a balcony, high "street" a gate."""
    import cv2

    count, parts, boxes, _ = cv2.connectedComponentsWithStats(outside.astype(np.uint8), connectivity=4)
    reaches = np.zeros(count, bool)
    reaches[parts[-1]] = True
    reaches &= boxes[:, cv2.CC_STAT_HEIGHT] <= CROP.max_street_share * len(outside)
    for edge in (parts[0], parts[:, 0], parts[:, -1]):
        reaches[edge] = True
    reaches[0] = False
    is_touching: BoolArray = reaches[parts]
    return is_touching
