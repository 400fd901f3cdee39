"""Fill unseen ground and walls by example from the pictures around them.

Like the completion by floors (floors paper, section 3.2), without floors. Candidates are the translations under which
the pictured surface matches itself. A graph cut assigns one to each hidden cell, with seams where they show least. The
parts are copied texel by texel, and their colours blended into the surroundings.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Int64Array, IntArray, UInt8Array
from facade_core.facade.texture.label_expansion import choose_sources
from facade_core.facade.texture.mosaic import fill_from_chosen_sources
from facade_core.facade.texture.source_costs import UNUSABLE_PRICE, SourceCosts
from facade_core.facade.texture.translations import correlate_masked
from facade_core.street.materials.settings import EXAMPLE_FILL


def fill_by_example(
    image: UInt8Array,
    known: BoolArray,
    fillable: BoolArray,
    kinds: UInt8Array,
    density: float,
    max_distance_m: float = EXAMPLE_FILL.max_fill_m,
) -> tuple[UInt8Array, BoolArray]:
    """Fill unknown texels by example from known ones.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    known : (h, w) bool, texels that a picture shows.
    fillable : (h, w) bool, texels that may be filled.
    kinds : (h, w) uint8 kind of ground by the map.
    density : texels per metre.
    max_distance_m : greatest distance from known texels, metres.

    Returns
    -------
    The image, and the filled texels (h, w) bool.
    """
    import cv2

    nothing = np.zeros(known.shape, bool)
    if known.sum() < EXAMPLE_FILL.min_example_m2 * density**2 or known.all():
        return image, nothing
    away = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    wanted = ~known & fillable & (away <= max_distance_m * density)
    factor = max(1, round(EXAMPLE_FILL.source_cell_m * density))
    out, done = image, known
    for _ in range(EXAMPLE_FILL.max_rounds):
        before = done
        out, done = _copy_parts(out, done, wanted & ~done, kinds, factor, factor / density)
        if (done | ~wanted).all() or (done == before).all():
            break
    filled = done & wanted
    if not filled.any():
        return image, nothing
    # sources are fitted to a texel, so that a few texels between parts stay empty
    side = max(3, round(EXAMPLE_FILL.max_crack_m * density))
    opened = cv2.morphologyEx((wanted & ~done).astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side), np.uint8)) > 0
    cracks = wanted & ~done & ~opened
    if cracks.any():
        filled |= cracks
        whole = np.where((done | cracks)[..., None], out, 0).astype(np.uint8)
        out = np.asarray(cv2.inpaint(whole, cracks.astype(np.uint8), 3, cv2.INPAINT_TELEA))
    return np.where(filled[..., None], out, image), filled


def _copy_parts(
    image: UInt8Array, known: BoolArray, wanted: BoolArray, kind: UInt8Array, factor: int, step: float
) -> tuple[UInt8Array, BoolArray]:
    """Copy parts to the wanted texels that translations reach.

    Returns the image and the known texels (h, w) bool. step: side of a cell, metres.
    """
    small, clear, hidden, kinds = _reduce_to_cells(image, known, wanted, kind, factor)
    rows, columns = np.nonzero(hidden)
    moves = _best_translations(small, clear, step) if len(rows) else np.zeros((0, 2), np.int64)
    if not len(moves):
        return image, known
    offers = _source_offers(small, clear, kinds, np.column_stack([rows, columns]), moves, step)
    reachable = (offers.price < UNUSABLE_PRICE).any(axis=0)
    if not reachable.any():
        return image, known
    offers = SourceCosts(offers.price[:, reachable], offers.colour[:, reachable])
    cells = np.column_stack([rows, columns])[reachable]
    number = np.full(hidden.shape, -1)
    number[cells[:, 0], cells[:, 1]] = np.arange(len(cells))
    edges = np.concatenate(
        [
            np.stack([a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]], axis=1)
            for a, b in ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
        ]
    )
    chosen = np.full(hidden.shape, -1)
    chosen[cells[:, 0], cells[:, 1]] = choose_sources(
        offers, edges, _seam_costs(small, clear, cells, moves), EXAMPLE_FILL.seam_cost
    )
    maps = np.column_stack([moves, np.zeros(len(moves), np.int64)])
    return fill_from_chosen_sources(image, known, chosen, maps, factor, EXAMPLE_FILL.context_m / step)


def _reduce_to_cells(
    image: UInt8Array, known: BoolArray, wanted: BoolArray, kind: UInt8Array, factor: int
) -> tuple[Float32Array, BoolArray, BoolArray, UInt8Array]:
    """Reduce texels to cells of `factor` texels.

    Returns colours in 0..1 float32, cells that are all known, other cells with a wanted texel, and kinds.
    """
    import cv2

    height, width = known.shape
    pad = (0, -height % factor), (0, -width % factor)
    whole = np.pad(image, (*pad, (0, 0)), mode="edge")
    tall, wide = whole.shape[0] // factor, whole.shape[1] // factor
    small = cv2.resize(whole, (wide, tall), interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
    blocks = [np.pad(mask, pad).reshape(tall, factor, wide, factor) for mask in (known, wanted)]
    clear = np.asarray(blocks[0].all(axis=(1, 3)))
    hidden = np.asarray(blocks[1].any(axis=(1, 3))) & ~clear
    return small, clear, hidden, np.pad(kind, pad, mode="edge")[factor // 2 :: factor, factor // 2 :: factor]


def _best_translations(small: Float32Array, clear: BoolArray, step: float) -> Int64Array:
    """Find translations (k, 2) in cells, down and right, under which the clear cells match best.

    Score: normalised correlation of detail, for all translations at once.
    """
    import cv2

    height, width = clear.shape
    weight = clear.astype(np.float32)
    sigma = EXAMPLE_FILL.shading_sigma_m / step
    local = cv2.GaussianBlur(small * weight[..., None], (0, 0), sigma)
    local = local / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-4)[..., None]
    # colour and detail: kerbs and carriageway edges show in both
    detail = (small - 0.7 * local - 0.3 * small[clear].mean(axis=0)).mean(axis=2) * weight
    score, seen = correlate_masked(detail, clear, detail, clear)
    down, right = np.mgrid[-height + 1 : height, -width + 1 : width]
    usable = (np.hypot(down, right) * step >= EXAMPLE_FILL.min_translation_m) & (
        seen >= EXAMPLE_FILL.min_overlap_share * clear.sum()
    )
    # long translations overlap little and fit by chance more often
    score = np.where(usable, score * np.clip(seen / clear.sum(), 0, 1) ** EXAMPLE_FILL.overlap_exponent, -1.0).astype(
        np.float32
    )
    top = (score == cv2.dilate(score, np.ones((5, 5), np.uint8))) & usable
    best = np.argsort(-score[top], kind="stable")[: EXAMPLE_FILL.max_translations]
    return np.stack([down[top][best], right[top][best]], axis=1).astype(np.int64)


def _source_offers(
    small: Float32Array, clear: BoolArray, kinds: UInt8Array, cells: Int64Array, moves: Int64Array, step: float
) -> SourceCosts:
    """Compute colour and cost of every translation (k, 2) at cells (n, 2).

    The cost measures how well the surroundings match.
    """
    import cv2

    usual = 2 * float(small[clear].var(axis=0).mean())
    side = 2 * round(EXAMPLE_FILL.context_m / step) + 1
    price = np.full((len(moves), len(cells)), UNUSABLE_PRICE, np.float32)
    colour = np.zeros((len(moves), len(cells), 3), np.float32)
    for k, move in enumerate(moves):
        sources, inside = _shift_cells(cells, move, clear.shape)
        inside[inside] = clear[sources[inside, 0], sources[inside, 1]]
        error, comparable = _translation_errors(small, clear, move)
        total, count = (
            cv2.blur(raster, (side, side), borderType=cv2.BORDER_CONSTANT) for raster in (error, comparable)
        )
        near = (total + EXAMPLE_FILL.evidence_prior * EXAMPLE_FILL.no_evidence_cost * usual) / (
            count + EXAMPLE_FILL.evidence_prior
        )
        target, source = cells[inside], sources[inside]
        wrong = kinds[target[:, 0], target[:, 1]] != kinds[source[:, 0], source[:, 1]]
        far = EXAMPLE_FILL.cost_per_metre * step * float(np.hypot(*move))
        price[k, inside] = near[target[:, 0], target[:, 1]] + usual * (EXAMPLE_FILL.other_kind_cost * wrong + far)
        colour[k, inside] = small[source[:, 0], source[:, 1]]
    return SourceCosts(price, colour)


def _shift_cells(cells: IntArray, move: IntArray, shape: tuple[int, ...]) -> tuple[IntArray, BoolArray]:
    """Return the shifted cells (n, 2) and a mask (n,) of those inside the raster."""
    shifted = cells + move
    return shifted, np.asarray(((shifted >= 0) & (shifted < shape)).all(axis=1))


def _translation_errors(small: Float32Array, clear: BoolArray, move: Int64Array) -> tuple[Float32Array, Float32Array]:
    """Compute the squared colour difference (r, c) of clear cells to shifted ones.

    Also returns where both are clear.
    """
    error, comparable = np.zeros(clear.shape, np.float32), np.zeros(clear.shape, np.float32)
    target = tuple(slice(max(0, -m), n - max(0, m)) for m, n in zip(move.tolist(), clear.shape, strict=True))
    source = tuple(slice(max(0, m), n + min(0, m)) for m, n in zip(move.tolist(), clear.shape, strict=True))
    both = clear[target] & clear[source]
    comparable[target] = both
    error[target] = np.square(small[target] - small[source]).mean(axis=2) * both
    return error, comparable


def _seam_costs(small: Float32Array, clear: BoolArray, cells: Int64Array, moves: Int64Array) -> Float32Array:
    """Compute the cost (k, n) of the seam to clear neighbours under every translation."""
    cost = np.zeros((len(moves), len(cells)), np.float32)
    for offset in np.array([(0, 1), (0, -1), (1, 0), (-1, 0)]):
        neighbours, rim = _shift_cells(cells, offset, clear.shape)
        rim[rim] = clear[neighbours[rim, 0], neighbours[rim, 1]]
        for k, move in enumerate(moves):
            sources, inside = _shift_cells(neighbours, move, clear.shape)
            both = rim & inside
            both[both] = clear[sources[both, 0], sources[both, 1]]
            a, b = neighbours[both], sources[both]
            cost[k, both] += (
                2 * EXAMPLE_FILL.seam_cost * np.abs(small[a[:, 0], a[:, 1]] - small[b[:, 0], b[:, 1]]).sum(axis=1)
            )
    return cost
