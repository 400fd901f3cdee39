"""Inpaint hidden parts of a facade by floors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.levelling import fill_unknown_values
from facade_core.core.types import Element
from facade_core.facade.texture.floor_inpainting import fill_by_floors
from facade_core.facade.texture.network_inpainting import fill_by_network, load_inpainting_network
from facade_core.facade.texture.settings import INPAINTING, PICTURES
from facade_core.facade.texture.validation import check_exemplar_image, check_exemplar_labels, check_mask
from facade_core.facade.texture.window_completion import complete_windows, framed_box
from facade_core.parsing.confidence import box_coverage
from facade_core.parsing.floor_structure import find_floors_and_bays

# Labels of the ground floor, and their smallest confidence to be drawn: the visible ground floor is a better guide than a
# guess.
_GROUND_LABELS = ("door", "shop")
# Elements of which at least this share is hidden come from repetitions, also beside a network: it continues what it sees.
_MIN_PLACED_SHARE = 0.5


def inpaint(
    image: UInt8Array,
    mask: BoolArray,
    *,
    labels: UInt8Array | None = None,
    elements: Sequence[Element] | None = None,
    model: Path | None = None,
) -> UInt8Array:
    """Fill the masked pixels of a facade; all other pixels keep their bits.

    Sources are whole floors and bays away (floors paper). Without any repetition they are where the rim fits best.
    Pixels without a source are diffused, and so are all where a side has less than `min_side_px` pixels, on which
    nothing repeats.

    Elements of a completed layout guide the sources: windows anywhere, doors and shops if likely. Each window and
    balcony is then completed from one source (`complete_windows`). A network knows no layout: it fills around the
    elements that are mostly hidden, so that these stay where the layout has them.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where to fill.
    labels : (H, W) uint8 class ids; they count outside the mask only.
    elements : elements of a completed layout, in pixels.
    model : .onnx file of LaMa, which replaces the rest of what floors and bays give.

    Returns
    -------
    (H, W, 3) uint8.

    Raises
    ------
    ImageError
        For bad arrays, or a mask without visible pixels.
    ModelFileError
        If the model cannot be used.
    """
    check_exemplar_image(image, min_side=1)
    check_mask(image, mask)
    if labels is not None:
        check_exemplar_labels(image, labels)
    if not mask.any():
        return image.copy()
    if min(mask.shape) < PICTURES.min_side_px:
        return np.where(mask[..., None], np.rint(fill_unknown_values(image, ~mask)).astype(np.uint8), image)
    likely = select_likely_elements(elements or ())
    guide = vote_across_bays(draw_guide(mask, labels, likely), agreed=INPAINTING.min_agreement)
    result = clip_to_visible_range(fill_by_floors(image, mask, guide), image, mask)
    result = complete_windows(result, mask, likely) if likely else result
    if model is None:
        return result
    mask = mask.copy()
    for element in likely:  # what the layout places in the hole is known to the network
        if box_coverage(mask, element) >= _MIN_PLACED_SHARE:
            x0, y0, x1, y1 = framed_box(element, mask.shape)
            mask[y0:y1, x0:x1] = False
    return clip_to_visible_range(fill_by_network(result, mask, load_inpainting_network(model)), result, mask)


def select_likely_elements(elements: Sequence[Element]) -> list[Element]:
    """Select the elements of a layout that are drawn: all windows and balconies, and likely doors and shops."""
    return [e for e in elements if e.confidence >= INPAINTING.min_ground_confidence or e.label not in _GROUND_LABELS]


def clip_to_visible_range(filled: UInt8Array, image: UInt8Array, mask: BoolArray) -> UInt8Array:
    """Return `filled` in the hole, within the range of the visible colours, and `image` elsewhere.

    Blending can push a dark pane beyond black.
    """
    seen = image[~mask]
    return np.where(mask[..., None], np.clip(filled, seen.min(axis=0), seen.max(axis=0)), image)


def draw_guide(mask: BoolArray, labels: UInt8Array | None, elements: Sequence[Element]) -> UInt8Array:
    """Draw class ids (H, W): visible labels, and the elements in the hole.

    The hole holds wall around windows and balconies, else UNKNOWN.

    A completed layout says where windows are, not that nothing else is there: it often lacks shops, and the neighbour
    of a shop or a door is often a shop.
    """
    guide = np.full(mask.shape, UNKNOWN, np.uint8) if labels is None else np.where(mask, UNKNOWN, labels)
    free = mask | (labels is None)
    drawn = [(e, FacadeClass.WALL, INPAINTING.wall_margin) for e in elements if e.label not in _GROUND_LABELS]
    for name in reversed(ELEMENT_CLASSES):
        drawn += [(e, FacadeClass(CLASSES.index(name)), 0.0) for e in elements if e.label == name]
    for e, label, margin in drawn:
        x, y = margin * e.width, margin * e.height
        rows, columns = (e.y0 - y, e.y1 + y), (e.x0 - x, e.x1 + x)
        box = tuple(slice(*(max(0, round(end)) for end in span)) for span in (rows, columns))
        guide[box] = np.where(free[box], label, guide[box])
    return guide


def vote_across_bays(guide: UInt8Array, *, agreed: float) -> UInt8Array:
    """Fill unknown labels by votes of the same rows of other bays, else by the most frequent label of the row.

    A pixel stays unknown if less than the share `agreed` of its votes agree.
    """
    if (guide == UNKNOWN).all():
        return guide
    shown = guide == np.arange(len(CLASSES), dtype=np.uint8)[:, None, None]
    votes = np.zeros(shown.shape, np.int32)
    found = find_floors_and_bays(guide)
    if found is not None:
        middles = [(a + b) // 2 for a, b in found.bays]
        for k, (left, right) in enumerate(zip(found.bay_cuts, found.bay_cuts[1:], strict=False)):
            for middle in middles[:k] + middles[k + 1 :]:
                shift = middle - middles[k]
                a, b = max(left, -shift), min(right, guide.shape[1] - shift)
                votes[..., a:b] += shown[..., a + shift : b + shift]
    cast = np.where(votes.any(0), votes, shown.sum(2, dtype=np.int32)[..., None])
    voted = cast.argmax(0)
    split = cast.max(0) < agreed * cast.sum(0)
    return np.where(guide != UNKNOWN, guide, np.where(split, UNKNOWN, voted)).astype(np.uint8)
