"""Inpainting with sources whole floors and bays away (floors paper), chosen jointly by graph cuts.

The paper clones one patch after another and splits patches without a source. Here every pixel chooses its
translation by the agreement of rows, columns and surroundings under it, so that parts are as large as possible.
"""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Int64Array, UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.facade.texture.label_expansion import choose_sources
from facade_core.facade.texture.mosaic import fill_from_chosen_sources
from facade_core.facade.texture.settings import INPAINTING
from facade_core.facade.texture.source_costs import UNUSABLE_PRICE, SourceCosts, compute_source_costs
from facade_core.facade.texture.translations import find_repeat_translations

# Contrast of the classes against wall in the search for repetitions of a planned layout.
_CLASS_WEIGHTS = np.array([0.0, 1.0, 0.5, 1.0, 0.0, 0.5, 0.0], np.float32)


def fill_by_floors(image: UInt8Array, mask: BoolArray, guide: UInt8Array) -> UInt8Array:
    """Fill hidden pixels from repetitions of floors and bays.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where to fill.
    guide : (H, W) uint8 class ids, 255 unknown.

    Returns
    -------
    (H, W, 3) uint8.
    """
    out, missing = image, mask
    for _ in range(INPAINTING.max_rounds):  # pixels beyond the reach of all translations are filled from filled ones
        out, done = _copy_repeats(out, missing, guide)
        if done.all() or not (done & missing).any():
            break
        missing = ~done
    return out if done.all() else np.asarray(cv2.inpaint(out, (~done).astype(np.uint8), 3, cv2.INPAINT_TELEA))


def _copy_repeats(image: UInt8Array, mask: BoolArray, guide: UInt8Array) -> tuple[UInt8Array, BoolArray]:
    """Return the image with copied pixels, and the known pixels (H, W) bool after that."""
    factor = int(np.clip(np.ceil(np.sqrt(mask.size / INPAINTING.max_working_px)), 1, INPAINTING.max_reduction))
    small, known, plan = _reduce_to_blocks(image, mask, guide, factor)
    if not known.any():  # the visible parts are smaller than the blocks
        factor, (small, known, plan) = 1, _reduce_to_blocks(image, mask, guide, 1)
    found = [find_repeat_translations(_local_detail(small.mean(2), known), known)]
    planned = plan != UNKNOWN
    if (planned & ~known).any():
        found.append(
            find_repeat_translations(_local_detail(_CLASS_WEIGHTS[np.where(planned, plan, 0)], planned), planned)
        )
    translations = np.unique(np.concatenate(found), axis=0)
    if not len(translations):  # too little is seen for any repetition
        return image, ~mask
    reach = max(known.shape) / INPAINTING.context_divisor
    roof, foot = _roof_and_foot_rows(plan, known)
    chosen = _choose_translations(small, known, plan, translations, reach, (roof, foot))
    return fill_from_chosen_sources(image, ~mask, chosen, translations, factor, reach)


def _reduce_to_blocks(
    image: UInt8Array, mask: BoolArray, guide: UInt8Array, factor: int
) -> tuple[Float32Array, BoolArray, UInt8Array]:
    """Reduce image (float32 0-1), known pixels and guide to blocks; a block is known if all of it is."""
    height, width = mask.shape
    pad = (0, -height % factor), (0, -width % factor)
    whole = np.pad(image, (*pad, (0, 0)), mode="edge")
    hidden = np.pad(mask, pad, mode="edge")
    tall, wide = hidden.shape[0] // factor, hidden.shape[1] // factor
    small = cv2.resize(whole, (wide, tall), interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
    known = np.asarray(~hidden.reshape(tall, factor, wide, factor).any((1, 3)))
    plan = np.ascontiguousarray(np.pad(guide, pad, mode="edge")[factor // 2 :: factor, factor // 2 :: factor])
    return small, known, plan


def _local_detail(grey: Float32Array, known: BoolArray) -> Float32Array:
    """Return a picture (H, W) less its local mean over known pixels, float32."""
    grey = grey * known
    sigma = max(grey.shape) / 12
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), sigma)
    local = cv2.GaussianBlur(grey, (0, 0), sigma) / np.maximum(weight, 1e-4)
    return np.where(known, grey - local, 0.0).astype(np.float32)


def _roof_and_foot_rows(plan: UInt8Array, known: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return the rows (h,) bool of the roof, dormers included, and those of the ground floor."""
    height = len(plan)
    label = np.where(known, plan, UNKNOWN)
    on_roof = ((label == FacadeClass.ROOF) | (label == FacadeClass.SKY)).sum(axis=1)
    is_roof = on_roof >= np.maximum(1, INPAINTING.min_roof_share * (label != UNKNOWN).sum(axis=1))
    below = np.flatnonzero(is_roof[: height // 2])
    rows = np.arange(height)
    tall = round(INPAINTING.foot_share * height) if height > 1 else 1
    return rows <= (below[-1] if len(below) else -1), rows >= height - max(1, tall)


def _forbid_foreign_rows(
    price: Float32Array, hidden: Int64Array, translations: Int64Array, roof: BoolArray, foot: BoolArray
) -> None:
    """Forbid sources of the ground floor on the roof, and elsewhere where the same row has one, in place.

    Parameters
    ----------
    price : (k, n) float32, UNUSABLE_PRICE without a source.
    hidden : (n, 2) rows and columns.
    translations : (k, 3) as in `compute_source_costs`.
    roof, foot : (h,) bool rows.
    """
    on_foot = np.flatnonzero(foot[hidden[:, 0]])
    source = np.clip(hidden[on_foot, 0] + translations[:, :1], 0, len(roof) - 1)
    costs = np.where(roof[source], UNUSABLE_PRICE, price[:, on_foot])
    is_beside = np.abs(translations[:, 0]) <= INPAINTING.level_tolerance_px
    has_beside = (costs[is_beside] < UNUSABLE_PRICE).any(axis=0)
    price[:, on_foot] = np.where(has_beside & ~is_beside[:, None], UNUSABLE_PRICE, costs)


def _choose_translations(
    image: Float32Array,
    known: BoolArray,
    plan: UInt8Array,
    translations: Int64Array,
    reach: float,
    roof_and_foot: tuple[BoolArray, BoolArray],
) -> Int64Array:
    """Return the index of the translation of every hidden pixel, (h, w) int64; -1 if known or without source."""
    hidden = np.argwhere(~known)
    sources = compute_source_costs(image, known, hidden, plan, translations, reach)
    _forbid_foreign_rows(sources.price, hidden, translations, *roof_and_foot)
    costs = _penalise_outliers(sources)
    kept = _select_translations(costs.price)
    served = (costs.price[kept] < UNUSABLE_PRICE).any(0)
    if not served.any():
        return np.full(known.shape, -1)
    hidden, costs = hidden[served], SourceCosts(costs.price[kept][:, served], costs.colour[kept][:, served])
    number = np.full(known.shape, -1)
    number[hidden[:, 0], hidden[:, 1]] = np.arange(len(hidden))
    edges = np.concatenate(
        [
            np.stack([a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]], 1)
            for a, b in ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
        ]
    )
    chosen = np.full(known.shape, -1)
    chosen[hidden[:, 0], hidden[:, 1]] = kept[
        choose_sources(
            costs, edges, _rim_prices(image, known, hidden, translations[kept], costs.colour), INPAINTING.seam_price
        )
    ]
    return chosen


def _penalise_outliers(costs: SourceCosts) -> SourceCosts:
    """Raise prices by the difference of a source from the mean of all sources, cheap ones weighted most.

    Most repetitions show what is likely to be hidden; an open window or a passer-by appears in one of them only. A
    missing source gets the mean colour, so that a seam to it costs no more than one to the likely content.
    """
    best = costs.price.min(0)
    usable = costs.price < UNUSABLE_PRICE
    trust = np.where(
        usable, np.exp((best - costs.price) / (INPAINTING.trust_scale * max(float(np.median(best)), 1e-9))), 0.0
    ).astype(np.float32)
    mean = np.einsum("kn,knc->nc", trust, costs.colour) / np.maximum(trust.sum(0), 1e-6)[:, None]
    apart = ((costs.colour - mean) ** 2).mean(2)
    price = np.where(usable, costs.price + INPAINTING.outlier_price * apart, UNUSABLE_PRICE).astype(np.float32)
    return SourceCosts(price, np.where(usable[..., None], costs.colour, mean))


def _select_translations(price: Float32Array) -> Int64Array:
    """Select greedily the translations that lower the sum of the lowest prices most."""
    best = np.full(price.shape[1], UNUSABLE_PRICE, np.float32)
    left, kept = list(range(len(price))), list[int]()
    while left and len(kept) < INPAINTING.max_translations:
        gains = [float(np.maximum(best - price[k], 0).sum()) for k in left]
        top = int(np.argmax(gains))
        if gains[top] <= INPAINTING.min_gain * price.shape[1] and kept:
            break
        kept.append(left.pop(top))
        best = np.minimum(best, price[kept[-1]])
    return np.array(sorted(kept))


def _rim_prices(
    image: Float32Array, known: BoolArray, hidden: Int64Array, translations: Int64Array, colour: Float32Array
) -> Float32Array:
    """Return the price of the seam to known neighbours under every translation, (k, n) float32."""
    height, width = known.shape
    cost = np.zeros((len(translations), len(hidden)), np.float32)
    y, x = hidden.T
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        q, r = y + dy, x + dx
        inside = (q >= 0) & (q < height) & (r >= 0) & (r < width)
        inside[inside] = known[q[inside], r[inside]]
        for k, (down, step, mirrored) in enumerate(translations):
            v, u = q[inside] + down, (step - r[inside]) if mirrored else r[inside] + step
            there = (v >= 0) & (v < height) & (u >= 0) & (u < width)
            there[there] = known[v[there], u[there]]
            at = np.flatnonzero(inside)[there]
            cost[k, at] += 2.0 * INPAINTING.seam_price * np.abs(image[q[at], r[at]] - image[v[there], u[there]]).sum(1)
    return cost
