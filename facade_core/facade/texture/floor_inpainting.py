"""Filling a hole with what lies whole floors and bays away (floors paper), all of it chosen at once by graph cuts.

The paper clones one patch after the other and splits those without a source; here every pixel chooses its
translation, priced by how well rows, columns and surroundings agree under it, so that parts are as large as they can be.
"""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.labels import UNKNOWN
from facade_core.facade.texture.floor_pitch import estimate_bay_width, estimate_floor_height
from facade_core.facade.texture.label_expansion import choose_sources
from facade_core.facade.texture.mosaic import paint_sources
from facade_core.facade.texture.source_costs import UNUSABLE_PRICE, SourceCosts, compute_source_costs
from facade_core.facade.texture.translations import find_translations

_MAX_WORKING_PX = 110_000  # px at which translations are chosen
_SEAM_PRICE = 0.02  # price of a seam, per colour difference (0-1, three channels)
# How much the classes stand out from the wall where repeats of a planned layout are looked for.
_CLASS_WEIGHTS = np.array([0.0, 1.0, 0.5, 1.0, 0.0, 0.5, 0.0], np.float32)
_MAX_REDUCTION = 8  # px of the image at most in one of those
_CONTEXT_DIVISOR = 24  # parts of the longer side: how far surroundings count
_TRUST_SCALE = 0.1  # of the usual best price: how much dearer an offer is that counts a third in the mean of all
_OUTLIER_PRICE = 1.0  # price of a squared difference from that mean
_MAX_ROUNDS = 4
_MAX_TRANSLATIONS = 28  # maps that the cuts choose from
_MIN_GAIN = 1e-5  # in price, for each hidden pixel, that a map must bring to be one of them


def fill_by_floors(image: np.ndarray, mask: np.ndarray, guide: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """image (H, W, 3) uint8 with the pixels of mask (H, W) filled; guide (H, W) uint8: class ids, 255 unknown."""
    out, missing = image, mask
    for _ in range(_MAX_ROUNDS):  # what lies beyond the reach of all translations is filled from what was filled
        out, done = _copy_repeats(out, missing, guide, rng)
        if done.all() or not (done & missing).any():
            break
        missing = ~done
    return out if done.all() else np.asarray(cv2.inpaint(out, (~done).astype(np.uint8), 3, cv2.INPAINT_TELEA))


def _copy_repeats(
    image: np.ndarray, mask: np.ndarray, guide: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The image with what could be copied, and what of it is now known (H, W) bool."""
    factor = int(np.clip(np.ceil(np.sqrt(mask.size / _MAX_WORKING_PX)), 1, _MAX_REDUCTION))
    small, known, plan = _reduce_to_blocks(image, mask, guide, factor)
    if not known.any():  # what is visible is finer than the blocks
        factor, (small, known, plan) = 1, _reduce_to_blocks(image, mask, guide, 1)
    byte = np.rint(small * 255.0).astype(np.uint8)
    pitches = estimate_floor_height(byte, ~known, rng), estimate_bay_width(byte, ~known, rng)
    found = [find_translations(_local_detail(small.mean(2), known), known), _pitch_translations(pitches, known.shape)]
    planned = plan != UNKNOWN
    if (planned & ~known).any():
        found.append(find_translations(_local_detail(_CLASS_WEIGHTS[np.where(planned, plan, 0)], planned), planned))
    maps = np.unique(np.concatenate(found), axis=0)
    reach = max(known.shape) / _CONTEXT_DIVISOR
    chosen = _choose_translations(small, known, plan, maps, reach)
    return paint_sources(image, ~mask, chosen, maps, factor, reach)


def _reduce_to_blocks(
    image: np.ndarray, mask: np.ndarray, guide: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image float32 0-1, known and guide, of blocks of factor px; a block is known if all of it is."""
    height, width = mask.shape
    pad = (0, -height % factor), (0, -width % factor)
    whole = np.pad(image, (*pad, (0, 0)), mode="edge")
    hidden = np.pad(mask, pad, mode="edge")
    tall, wide = hidden.shape[0] // factor, hidden.shape[1] // factor
    small = cv2.resize(whole, (wide, tall), interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
    known = np.asarray(~hidden.reshape(tall, factor, wide, factor).any((1, 3)))
    plan = np.ascontiguousarray(np.pad(guide, pad, mode="edge")[factor // 2 :: factor, factor // 2 :: factor])
    return small, known, plan


def _local_detail(grey: np.ndarray, known: np.ndarray) -> np.ndarray:
    """A picture (H, W) less its local mean over what is known, float32."""
    grey = grey * known
    sigma = max(grey.shape) / 12
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), sigma)
    local = cv2.GaussianBlur(grey, (0, 0), sigma) / np.maximum(weight, 1e-4)
    return np.where(known, grey - local, 0.0).astype(np.float32)


def _pitch_translations(pitches: tuple[int | None, int | None], shape: tuple[int, int]) -> np.ndarray:
    """Maps (n, 3), as `repeats` gives them, by multiples of the floor height and of the bay width."""
    found = [np.zeros((0, 3), int)]
    for axis, pitch in enumerate(pitches):
        if pitch is not None:
            steps = np.arange(1, shape[axis] // pitch + 1) * pitch
            table = np.zeros((2 * len(steps), 3), int)
            table[:, axis] = np.concatenate([-steps, steps])
            found.append(table)
    return np.concatenate(found)


def _choose_translations(
    image: np.ndarray, known: np.ndarray, plan: np.ndarray, maps: np.ndarray, reach: float
) -> np.ndarray:
    """The number of the map that every hidden pixel is taken from, (h, w) int64; -1 where it is known or has none."""
    hidden = np.argwhere(~known)
    offer = _penalise_outliers(compute_source_costs(image, known, hidden, plan, maps, reach))
    kept = _select_translations(offer.price)
    served = (offer.price[kept] < UNUSABLE_PRICE).any(0)
    if not served.any():
        return np.full(known.shape, -1)
    hidden, offer = hidden[served], SourceCosts(offer.price[kept][:, served], offer.colour[kept][:, served])
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
        choose_sources(offer, edges, _rim_prices(image, known, hidden, maps[kept], offer.colour), _SEAM_PRICE)
    ]
    return chosen


def _penalise_outliers(offer: SourceCosts) -> SourceCosts:
    """Prices raised by how far an offer is from the mean of all, the cheap ones counting most: what most repeats show is
    what is likely to be hidden, and what one of them alone shows (an open window, a passer-by) is not. A map without an offer
    has that mean's colour: a seam to it costs no more than one to what is likely there."""
    best = offer.price.min(0)
    usable = offer.price < UNUSABLE_PRICE
    trust = np.where(
        usable, np.exp((best - offer.price) / (_TRUST_SCALE * max(float(np.median(best)), 1e-9))), 0.0
    ).astype(np.float32)
    mean = np.einsum("kn,knc->nc", trust, offer.colour) / np.maximum(trust.sum(0), 1e-6)[:, None]
    apart = ((offer.colour - mean) ** 2).mean(2)
    price = np.where(usable, offer.price + _OUTLIER_PRICE * apart, UNUSABLE_PRICE).astype(np.float32)
    return SourceCosts(price, np.where(usable[..., None], offer.colour, mean))


def _select_translations(price: np.ndarray) -> np.ndarray:
    """Greedily, the maps that lower the sum of the lowest prices most."""
    best = np.full(price.shape[1], UNUSABLE_PRICE, np.float32)
    left, kept = list(range(len(price))), list[int]()
    while left and len(kept) < _MAX_TRANSLATIONS:
        gains = [float(np.maximum(best - price[k], 0).sum()) for k in left]
        top = int(np.argmax(gains))
        if gains[top] <= _MIN_GAIN * price.shape[1] and kept:
            break
        kept.append(left.pop(top))
        best = np.minimum(best, price[kept[-1]])
    return np.array(sorted(kept))


def _rim_prices(
    image: np.ndarray, known: np.ndarray, hidden: np.ndarray, maps: np.ndarray, colour: np.ndarray
) -> np.ndarray:
    """What the seam to known neighbours costs under every map, (k, n) float32."""
    height, width = known.shape
    cost = np.zeros((len(maps), len(hidden)), np.float32)
    y, x = hidden.T
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        q, r = y + dy, x + dx
        inside = (q >= 0) & (q < height) & (r >= 0) & (r < width)
        inside[inside] = known[q[inside], r[inside]]
        for k, (down, step, mirrored) in enumerate(maps):
            v, u = q[inside] + down, (step - r[inside]) if mirrored else r[inside] + step
            there = (v >= 0) & (v < height) & (u >= 0) & (u < width)
            there[there] = known[v[there], u[there]]
            at = np.flatnonzero(inside)[there]
            cost[k, at] += 2.0 * _SEAM_PRICE * np.abs(image[q[at], r[at]] - image[v[there], u[there]]).sum(1)
    return cost
