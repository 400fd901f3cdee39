"""A picture of a facade, cut to the facade: sky above it, the street before it and neighbours beside it are no wall."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facade_core.core.types import Box
from facade_core.parsing.segmenter import outside_mask

# A facade that is less than this share of its picture is not believed: the picture stays whole.
LEAST = 0.25
# Sides of the picture are told within one part of so many.
PARTS = 192
# A run from a wall's foot is street up to this share of its height, where this share of its columns has one: a bare wall is
# taken for a neighbour's from top to bottom, and a plinth for street in places.
MOST_FOOT, COLUMNS = 0.25, 0.3
# What is hidden counts so little, for the box: it stays where it costs nothing.
_NEITHER = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class FacadeCrop:
    """The part of a picture that is the facade: image (h, w, 3) uint8; hidden (h, w) bool, what does not show it; outside
    (h, w) bool, what shows sky, street or neighbours at its borders; box (x0, y0, x1, y1) of it in the picture, half-open;
    found, whether there is a facade in the picture: where there is none that is believed, it stays whole."""

    image: np.ndarray
    hidden: np.ndarray
    outside: np.ndarray
    box: Box
    found: bool = True


def crop_to_facade(image: np.ndarray, hidden: np.ndarray, *, model: Path | None = None) -> FacadeCrop:
    """A picture (H, W, 3) uint8, of which hidden (H, W) bool does not show the facade, cut to it, by the parser's model or the
    shipped one; whole where it shows none."""
    height, width = hidden.shape
    box = None
    if not hidden.all():
        outside = outside_mask(image, hidden, model=model)
        box = find_facade_box(outside, hidden)
    if box is None:
        return FacadeCrop(image, hidden, np.zeros_like(hidden), (0, 0, width, height), found=False)
    x0, y0, x1, y1 = box
    part = np.s_[y0:y1, x0:x1]
    return FacadeCrop(image[part], hidden[part], _from_border(outside[part]), box)


def street_mask(image: np.ndarray, hidden: np.ndarray, *, model: Path | None = None) -> np.ndarray:
    """Where a posed panorama shows, on a wall of the model, the street below the real wall's foot, (h, w) bool: heights of
    models, of cameras and of the ground between are seldom right to the metre.

    image (h, w, 3) uint8 is the wall; hidden (h, w) bool, what does not show it. Counted are runs of pixels from the raster's
    last row up, by columns; what stands on the street interrupts none. Neighbours are not looked for: where a wall ends
    sideways the model tells, and a bare one looks like a neighbour. Nor is the sky, which looks like plaster.
    """
    if hidden.all():
        return np.zeros_like(hidden)
    street = (outside_mask(image, hidden, model=model) & ~hidden)[::-1]
    run = np.logical_and.accumulate(street | hidden[::-1], axis=0)
    length = run.sum(axis=0)
    length[(length > MOST_FOOT * len(street)) | ~(run & street).any(axis=0)] = 0
    if (length > 0).sum() < COLUMNS * (~hidden.all(axis=0)).sum():
        return np.zeros_like(hidden)
    return np.asarray((np.arange(len(street))[::-1, None] < length) & ~hidden)


def find_facade_box(outside: np.ndarray, hidden: np.ndarray) -> Box | None:
    """The box (x0, y0, x1, y1), of all, in which pixels of the facade outnumber those outside (H, W) bool by most; hidden ones
    count for neither. None where that is less than LEAST of the picture.

    All boxes of a picture of PARTS x PARTS cells are compared: for each pair of rows the greatest run of columns (Kadane).
    """
    import cv2

    height, width = outside.shape
    size = (min(width, PARTS), min(height, PARTS))
    beside, unseen = (
        cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) / 255.0
        for mask in (outside & ~hidden, hidden)
    )
    value = (1 - unseen) - 2 * beside + _NEITHER * unseen
    above = np.concatenate([np.zeros((1, size[0])), np.cumsum(value, axis=0)])
    best, found = 0.0, None
    for top in range(size[1]):
        sums = np.cumsum(above[top + 1 :] - above[top], axis=1)
        sums = np.concatenate([np.zeros((len(sums), 1)), sums], axis=1)
        gain = sums - np.minimum.accumulate(sums, axis=1)
        bottom, right = divmod(int(gain.argmax()), gain.shape[1])
        if gain[bottom, right] > best:
            best = gain[bottom, right]
            found = (int(sums[bottom, : right + 1].argmin()), top, right, top + bottom + 1)
    if found is None:
        return None
    x0, x1 = (round(x * width / size[0]) for x in found[::2])
    y0, y1 = (round(y * height / size[1]) for y in found[1::2])
    return (x0, y0, x1, y1) if (y1 - y0) * (x1 - x0) >= LEAST * outside.size else None


def _from_border(outside: np.ndarray) -> np.ndarray:
    """The parts that reach the border: what is taken for sky inside a facade is a pane or a gap in a balcony."""
    import cv2

    count, parts = cv2.connectedComponents(outside.astype(np.uint8), connectivity=4)
    reaches = np.zeros(count, bool)
    for edge in (parts[0], parts[-1], parts[:, 0], parts[:, -1]):
        reaches[edge] = True
    reaches[0] = False
    return reaches[parts]
