"""What was hidden, filled: by floors, by tiles, or by whichever agrees better with what is seen around the hole."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from facade_core.errors import ImageError
from facade_core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, WALL
from facade_core.texture.checks import check_image, check_labels, check_mask
from facade_core.texture.floors import fill_by_floors
from facade_core.texture.hidden_tiles import fill_by_tiles
from facade_core.texture.structure import structure
from facade_core.types import Element

METHODS = ("auto", "floors", "tiles")
_HELD_BACK = 12  # px around the hole that are hidden too, to see which method predicts them better
_TRUST = 0.85  # tiles must beat floors by this factor: their wider warps look worse than the band's error says


def inpaint(
    image: np.ndarray,
    mask: np.ndarray,
    *,
    labels: np.ndarray | None = None,
    elements: Sequence[Element] | None = None,
    method: str = "auto",
    seed: int = 0,
) -> np.ndarray:
    """image (H, W, 3) uint8 with the pixels of mask (H, W) bool filled; all others keep their bits.

    method "floors" clones large patches a whole number of floors away (floors paper); "tiles" lays visible tiles
    (tiles paper; needs labels (H, W) uint8 or elements); "auto" hides a band of 12 px more, fills it by both at half
    size and takes the tiles where their squared error on that band is clearly smaller. Without labels and elements it
    is "floors". Labels count only outside the mask.

    elements in pixels, from a completed layout, say where windows go: sources that put elements on elements are
    preferred. Without any repetition "floors" takes the best patch anywhere, then diffusion. Raises ImageError for bad
    arrays, a mask without visible pixels, an unknown method, or "tiles" without labels and elements.
    """
    check_image(image)
    check_mask(image, mask)
    if labels is not None:
        check_labels(image, labels)
    if method not in METHODS:
        raise ImageError(f"inpaint: method {method!r} is unknown; pass one of {', '.join(METHODS)}")
    if method == "tiles" and labels is None and not elements:
        raise ImageError("inpaint: method 'tiles' needs labels=parse(image).labels or elements; or use method='floors'")
    if not mask.any():
        return image.copy()
    guide = _guide(mask, labels, elements)
    if method == "auto":
        method = _choose(image, mask, labels, guide, seed)
    filled = _fill(method, image, mask, labels, guide, seed)
    return np.where(mask[..., None], filled, image)


def _guide(mask: np.ndarray, labels: np.ndarray | None, elements: Sequence[Element] | None) -> np.ndarray:
    """Class ids (H, W): labels where visible, elements everywhere, wall in the hole if there are elements."""
    guide = np.full(mask.shape, UNKNOWN, np.uint8) if labels is None else np.where(mask, UNKNOWN, labels)
    if elements:
        guide = np.where(guide == UNKNOWN, WALL, guide).astype(np.uint8)
        for name in reversed(ELEMENT_CLASSES):
            for e in elements:
                if e.label == name:
                    box = np.s_[max(0, round(e.y0)) : max(0, round(e.y1)), max(0, round(e.x0)) : max(0, round(e.x1))]
                    free = mask[box] | (labels is None)
                    guide[box] = np.where(free, CLASSES.index(name), guide[box])
    return guide


def _fill(
    method: str, image: np.ndarray, mask: np.ndarray, labels: np.ndarray | None, guide: np.ndarray, seed: int
) -> np.ndarray:
    rng = np.random.default_rng(seed)
    if labels is not None:
        guide = np.where(mask & (guide != UNKNOWN), guide, np.where(mask, UNKNOWN, labels)).astype(np.uint8)
    complete = _carried_along(guide) if (guide != UNKNOWN).any() else guide
    if method == "floors":
        return fill_by_floors(image, mask, labels, complete, rng)
    from facade_core.parse import lattice

    return fill_by_tiles(image, mask, complete, lattice(complete), rng)


def _carried_along(guide: np.ndarray) -> np.ndarray:
    """Labels with unknown pixels voted for by the same rows of other bays; where none is known, the row's usual one."""
    classes = np.arange(len(CLASSES))
    counts = (guide[..., None] == classes).sum(1)
    usual = counts.argmax(1).astype(np.uint8)
    votes = np.zeros((*guide.shape, len(CLASSES)), np.int32)
    found = structure(guide)
    if found is not None:
        middles = [(a + b) // 2 for a, b in found.bays]
        for k, (left, right) in enumerate(zip(found.bay_cuts, found.bay_cuts[1:], strict=False)):
            for middle in middles[:k] + middles[k + 1 :]:
                shift = middle - middles[k]
                a, b = max(left, -shift), min(right, guide.shape[1] - shift)
                votes[:, a:b] += guide[:, a + shift : b + shift, None] == classes
    voted = np.where(votes.any(2), votes.argmax(2).astype(np.uint8), usual[:, None])
    return np.where(guide == UNKNOWN, voted, guide).astype(np.uint8)


def _choose(image: np.ndarray, mask: np.ndarray, labels: np.ndarray | None, guide: np.ndarray, seed: int) -> str:
    """The method that predicts a held-back visible band around the hole better, tried at half size."""
    if labels is None and (guide == UNKNOWN).any():
        return "floors"
    size = max(16, mask.shape[1] // 2), max(16, mask.shape[0] // 2)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    hole = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
    kinds = None if labels is None else cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST)
    plan = cv2.resize(guide, size, interpolation=cv2.INTER_NEAREST)
    wider = cv2.dilate(hole.astype(np.uint8), np.ones((_HELD_BACK + 1, _HELD_BACK + 1), np.uint8)) > 0
    band = wider & ~hole
    if not band.any() or wider.all():
        return "floors"
    errors = {}
    for method in ("floors", "tiles"):
        try:
            filled = _fill(method, small, wider, kinds, plan, seed)
        except ImageError:  # no whole tile is left
            continue
        errors[method] = float(((filled[band].astype(np.float32) - small[band]) ** 2).mean())
    return "tiles" if errors.get("tiles", np.inf) < _TRUST * errors.get("floors", np.inf) else "floors"
