"""What was hidden, filled: by floors or by tiles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.levelling import fill_unknown
from facade_core.core.types import Element
from facade_core.facade.texture.floor_inpainting import fill_by_floors
from facade_core.facade.texture.tile_inpainting import fill_by_tiles
from facade_core.facade.texture.validation import MIN_SIDE_PX, check_exemplar_image, check_exemplar_labels, check_mask
from facade_core.facade.texture.window_completion import complete_windows
from facade_core.parsing.floor_structure import find_structure

METHODS = ("floors", "tiles")
_WALL_MARGIN = 0.3  # of an element's size: how far around it a layout tells that there is wall
# A door or a shop that a layout holds for less likely is not drawn: the ground floor that is seen tells more than a guess.
_GROUND_LABELS, _MIN_GROUND_CONFIDENCE = ("door", "shop"), 0.3
_MIN_AGREEMENT = 0.7  # share of the votes of other bays that a plan for "floors" needs


def inpaint(
    image: np.ndarray,
    mask: np.ndarray,
    *,
    labels: np.ndarray | None = None,
    elements: Sequence[Element] | None = None,
    method: str = "floors",
    seed: int = 0,
) -> np.ndarray:
    """image (H, W, 3) uint8 with the pixels of mask (H, W) bool filled; all others keep their bits.

    method "floors" clones what lies whole floors and bays away (floors paper); "tiles" lays visible tiles (tiles
    paper; needs labels (H, W) uint8 or elements). Labels count only outside the mask.

    elements in pixels, from a completed layout, say where windows go, and doors and shops that are likely: sources that put
    elements on elements are preferred, and by "floors" each window and balcony is of one piece (`whole`). Without any
    repetition "floors" copies from where the rim fits best; what has no source is diffused, and so is all where a side has
    less than LEAST_SIDE pixels, on which nothing repeats.
    Raises ImageError for bad arrays, a mask without visible pixels, an unknown method, or "tiles" without labels and
    elements.
    """
    check_exemplar_image(image, min_side=1)
    check_mask(image, mask)
    if labels is not None:
        check_exemplar_labels(image, labels)
    if method not in METHODS:
        raise ImageError(f"inpaint: method {method!r} is unknown; pass one of {', '.join(METHODS)}")
    if method == "tiles" and labels is None and not elements:
        raise ImageError("inpaint: method 'tiles' needs labels=parse(image).labels or elements; or use method='floors'")
    if not mask.any():
        return image.copy()
    if min(mask.shape) < MIN_SIDE_PX:
        return np.where(mask[..., None], np.rint(fill_unknown(image, ~mask)).astype(np.uint8), image)
    likely = [e for e in elements or () if e.confidence >= _MIN_GROUND_CONFIDENCE or e.label not in _GROUND_LABELS]
    filled = _fill(method, image, mask, _draw_guide(mask, labels, likely), seed)
    # Blending can carry a dark pane beyond black: nothing is darker, nor brighter, than what is seen.
    seen = image[~mask]
    result = np.where(mask[..., None], np.clip(filled, seen.min(axis=0), seen.max(axis=0)), image)
    return complete_windows(result, mask, likely) if likely and method == "floors" else result


def _draw_guide(mask: np.ndarray, labels: np.ndarray | None, elements: Sequence[Element]) -> np.ndarray:
    """Class ids (H, W): labels where visible; in the hole elements, wall right around windows and balconies, and else UNKNOWN.

    A completed layout says where windows go, not that nothing else is there: it often knows of no shop, and beside a shop or a
    door is often the next shop.
    """
    guide = np.full(mask.shape, UNKNOWN, np.uint8) if labels is None else np.where(mask, UNKNOWN, labels)
    free = mask | (labels is None)
    drawn = [(e, FacadeClass.WALL, _WALL_MARGIN) for e in elements if e.label not in _GROUND_LABELS]
    for name in reversed(ELEMENT_CLASSES):
        drawn += [(e, FacadeClass(CLASSES.index(name)), 0.0) for e in elements if e.label == name]
    for e, label, margin in drawn:
        x, y = margin * e.width, margin * e.height
        rows, columns = (e.y0 - y, e.y1 + y), (e.x0 - x, e.x1 + x)
        box = tuple(slice(*(max(0, round(end)) for end in span)) for span in (rows, columns))
        guide[box] = np.where(free[box], label, guide[box])
    return guide


def _fill(method: str, image: np.ndarray, mask: np.ndarray, guide: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    if method == "floors":
        return fill_by_floors(image, mask, _vote_across_bays(guide, agreed=_MIN_AGREEMENT), rng)
    from facade_core.parsing.lattice import lattice

    complete = _vote_across_bays(guide, agreed=0.0)
    return fill_by_tiles(image, mask, complete, lattice(complete), rng)


def _vote_across_bays(guide: np.ndarray, *, agreed: float) -> np.ndarray:
    """Labels with unknown pixels voted for by the same rows of other bays; where none is known, the row's usual one.

    A pixel on which less than the share `agreed` of the votes agree stays unknown."""
    if (guide == UNKNOWN).all():
        return guide
    classes = np.arange(len(CLASSES))
    counts = (guide[..., None] == classes).sum(1)
    usual = counts.argmax(1).astype(np.uint8)
    votes = np.zeros((*guide.shape, len(CLASSES)), np.int32)
    found = find_structure(guide)
    if found is not None:
        middles = [(a + b) // 2 for a, b in found.bays]
        for k, (left, right) in enumerate(zip(found.bay_cuts, found.bay_cuts[1:], strict=False)):
            for middle in middles[:k] + middles[k + 1 :]:
                shift = middle - middles[k]
                a, b = max(left, -shift), min(right, guide.shape[1] - shift)
                votes[:, a:b] += guide[:, a + shift : b + shift, None] == classes
    voted = np.where(votes.any(2), votes.argmax(2).astype(np.uint8), usual[:, None])
    cast = np.where(votes.any(2, keepdims=True), votes, counts[:, None])
    split = cast.max(2) < agreed * cast.sum(2)
    return np.where(guide != UNKNOWN, guide, np.where(split, UNKNOWN, voted)).astype(np.uint8)
