"""Energy of a tiling (tiles paper, Eq. 4-6), tabulated once per exemplar.

Approximations, which reduce a generation to look-ups:

* Photo consistency (Eq. 5): the 6 px strip over a tile boundary is compared after area reduction to `strip_samples`
samples along the boundary. The nearest exemplar window is searched among the strips over every lattice boundary
and an even spread of other positions, at most `max_windows` in all; strips over neighbours of the exemplar have
distance 0.
* Structural consistency (Eq. 6): label histograms are rounded to 1/16, so tiles fall into few kinds and the
exemplar's templates into few distinct rows of kinds.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.distance import cdist

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.labels import CLASSES
from facade_core.core.numba_cache import njit
from facade_core.core.types import Lattice
from facade_core.facade.texture.settings import SYNTHESIS

TEMPLATE_ORDER = 4
_LABEL_BINS = len(CLASSES) + 1


class EnergyTables(NamedTuple):
    """Look-up tables of T tiles. Every entry is the exponent d^2 / (2 zeta^2) of its equation.

    Attributes
    ----------
    photo_right, photo_below : (T, T) float32, [i, j] with j right of or below i.
    kind : (T,) int32.
    kind_distance : (K, K) float32, squared.
    templates_right, templates_below : (R, order) int32 kinds in the exemplar.
    scale_right, scale_below : 1 / (2 zeta^2) of Eq. 6.
    """

    photo_right: Float32Array
    photo_below: Float32Array
    kind: Int32Array
    kind_distance: Float32Array
    templates_right: Int32Array
    templates_below: Int32Array
    scale_right: float
    scale_below: float


def tabulate_energy(
    image: UInt8Array, labels: UInt8Array, lattice: Lattice, *, usable: BoolArray | None = None
) -> EnergyTables:
    """Tabulate Eq. 5 and 6 over a lattice of T tiles.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    lattice : lattice of the exemplar.
    usable : (rows, columns) bool, False for hidden tiles, which are no part of windows and templates.
    """
    rows, columns = np.asarray(lattice.rows), np.asarray(lattice.columns)
    seen = np.ones((len(rows) - 1, len(columns) - 1), bool) if usable is None else usable
    right = _photo_consistency(image, rows, columns, seen)
    below = _photo_consistency(np.ascontiguousarray(image.transpose(1, 0, 2)), columns, rows, seen.T)
    order = np.arange(seen.size).reshape(seen.T.shape).T.ravel()  # transposed numbering -> row-major
    below = np.ascontiguousarray(below[np.ix_(order, order)])
    kind, kind_distance = _tile_kinds(labels, rows, columns)
    grid = kind.reshape(seen.shape)
    across, down = _templates(grid, seen), _templates(grid.T, seen.T)
    return EnergyTables(
        right,
        below,
        kind,
        kind_distance,
        across,
        down,
        _structure_scale(kind, kind_distance, across),
        _structure_scale(kind, kind_distance, down),
    )


def label_histograms(labels: UInt8Array, rows: Int64Array, columns: Int64Array) -> Float64Array:
    """Return label histograms of all tiles, (rows * columns, classes + 1), each of sum 1; the last bin is UNKNOWN.

    Parameters
    ----------
    labels : (H, W) uint8 class ids.
    rows, columns : borders of the tiles.
    """
    onehot = np.minimum(labels, _LABEL_BINS - 1)[..., None] == np.arange(_LABEL_BINS)
    sums = np.add.reduceat(onehot.astype(np.float64), rows[:-1], axis=0)
    sums = np.add.reduceat(sums, columns[:-1], axis=1)
    area = np.diff(rows)[:, None] * np.diff(columns)[None, :]
    histograms: Float64Array = (sums / area[..., None]).reshape(-1, _LABEL_BINS)
    return histograms


def _tile_kinds(labels: UInt8Array, rows: Int64Array, columns: Int64Array) -> tuple[Int32Array, Float32Array]:
    rounded = np.rint(label_histograms(labels, rows, columns) * SYNTHESIS.histogram_steps) / SYNTHESIS.histogram_steps
    distinct, kind = np.unique(rounded, axis=0, return_inverse=True)
    distance = ((distinct[:, None] - distinct[None]) ** 2).sum(-1)
    return kind.reshape(-1).astype(np.int32), distance.astype(np.float32)


def _templates(grid: Int32Array, seen: BoolArray) -> Int32Array:
    """Return the distinct runs of TEMPLATE_ORDER kinds along the second axis in which every tile is visible."""
    order = min(TEMPLATE_ORDER, grid.shape[1])
    runs = np.lib.stride_tricks.sliding_window_view(grid, order, axis=1).reshape(-1, order)
    whole = np.lib.stride_tricks.sliding_window_view(seen, order, axis=1).reshape(-1, order).all(1)
    return np.ascontiguousarray(np.unique(runs[whole] if whole.any() else runs, axis=0), np.int32)


def _structure_scale(kind: Int32Array, distance: Float32Array, templates: Int32Array) -> float:
    """Return 1 / (2 zeta^2), zeta = 10 % of the range of distances over a fixed sample of random tile rows."""
    sample = kind[np.random.default_rng(0).integers(0, len(kind), (512, templates.shape[1]))]
    squared = sum(distance[sample[:, k, None], templates[None, :, k]] for k in range(templates.shape[1]))
    nearest = np.sqrt(np.asarray(squared).min(1))
    return _exponent_scale(float(nearest.max() - nearest.min()))


def _exponent_scale(span: float) -> float:
    return 1.0 / (2.0 * (SYNTHESIS.zeta_share * span) ** 2) if span > 1e-6 else 1.0


def _photo_consistency(image: UInt8Array, rows: Int64Array, columns: Int64Array, seen: BoolArray) -> Float32Array:
    """Return Eq. 5 for all ordered pairs (left tile, right tile), (T, T) float32 exponents."""
    height, width = seen.shape
    # Rows are reduced once per band, (bands, strip_samples, W, 3); a half-strip is then three columns.
    bands = np.stack(
        [
            cv2.resize(image[a:b], (image.shape[1], SYNTHESIS.strip_samples), interpolation=cv2.INTER_AREA)
            for a, b in zip(rows, rows[1:], strict=False)
        ]
    ).astype(np.float32)
    inner = np.arange(SYNTHESIS.half_strip_px)
    right_columns = np.maximum(columns[1:, None] - SYNTHESIS.half_strip_px + inner, columns[:-1, None])
    left_columns = np.minimum(columns[:-1, None] + inner, columns[1:, None] - 1)
    right_edge = bands[:, :, right_columns].transpose(0, 2, 1, 3, 4).reshape(height * width, -1)
    left_edge = bands[:, :, left_columns].transpose(0, 2, 1, 3, 4).reshape(height * width, -1)
    band, at = _exemplar_windows(columns, seen)
    reach = image.shape[1] - 1
    before = (
        bands[band[:, None], :, np.clip(at[:, None] - SYNTHESIS.half_strip_px + inner, 0, reach)]
        .transpose(0, 2, 1, 3)
        .reshape(len(at), -1)
    )
    after = bands[band[:, None], :, np.clip(at[:, None] + inner, 0, reach)].transpose(0, 2, 1, 3).reshape(len(at), -1)
    samples = float(2 * right_edge.shape[1])
    squared = _min_pair_sums(
        _squared_distances(right_edge, before) / samples, _squared_distances(left_edge, after) / samples
    )
    grid = np.arange(height * width).reshape(height, width)
    squared[grid[:, :-1].ravel(), grid[:, 1:].ravel()] = 0.0
    distance = np.sqrt(squared)
    consistency: Float32Array = squared * np.float32(_exponent_scale(float(distance.max() - distance.min())))
    return consistency


def _exemplar_windows(columns: Int64Array, seen: BoolArray) -> tuple[Int64Array, Int64Array]:
    """Return (band, column) of the windows that represent "anywhere in X": all boundaries, then an even spread."""
    edges = [
        (b, columns[c]) for b in range(seen.shape[0]) for c in range(1, seen.shape[1]) if seen[b, c - 1 : c + 1].all()
    ]
    free = [
        (b, x)
        for b in range(seen.shape[0])
        for c in range(seen.shape[1])
        if seen[b, c]
        for x in range(
            columns[c] + SYNTHESIS.half_strip_px, columns[c + 1] - SYNTHESIS.half_strip_px + 1, SYNTHESIS.half_strip_px
        )
    ]
    edges = edges[:: max(1, -(-len(edges) // (SYNTHESIS.max_windows // 2)))]
    wanted = SYNTHESIS.max_windows - len(edges)
    both = np.array(edges + free[:: max(1, -(-len(free) // wanted))] or [(0, columns[-1] // 2)])
    return both[:, 0], both[:, 1]


def _squared_distances(a: Float32Array, b: Float32Array) -> Float32Array:
    """Return squared Euclidean distances between rows, float32; no BLAS, since its sums depend on threads."""
    distances: Float32Array = cdist(a, b, "sqeuclidean").astype(np.float32)
    return distances


@njit(cache=True, fastmath={"nnan", "ninf", "nsz", "reassoc"})
def _min_pair_sums(left: Float32Array, right: Float32Array) -> Float32Array:
    """Return [i, j] = min over windows c of left[i, c] + right[j, c]; a minimum is exact in any order."""
    out = np.empty((left.shape[0], right.shape[0]), np.float32)
    for i in range(left.shape[0]):
        for j in range(right.shape[0]):
            best = np.float32(3e38)
            for c in range(left.shape[1]):
                best = min(best, left[i, c] + right[j, c])
            out[i, j] = best
    return out


@njit(cache=True)
def update_costs(
    tables: EnergyTables, cost: Float64Array, tiles: Int32Array, y0: int, y1: int, x0: int, x1: int
) -> None:
    """Recompute the costs that depend on tiles[y0:y1, x0:x1].

    Parameters
    ----------
    tables : energy of pairs of tiles.
    cost : (4, M, N) Eq. 5 right, below, Eq. 6 right, below; changed in place.
    tiles : (M, N) int32.
    y0, y1, x0, x1 : changed block, which may be empty.
    """
    right, below, kind, distance, across, down, scale_right, scale_below = tables
    height, width = tiles.shape
    if y0 >= y1:
        return
    for y in range(y0, y1):
        for x in range(max(0, x0 - 1), min(x1, width - 1)):
            cost[0, y, x] = right[tiles[y, x], tiles[y, x + 1]]
    for y in range(max(0, y0 - 1), min(y1, height - 1)):
        for x in range(x0, x1):
            cost[1, y, x] = below[tiles[y, x], tiles[y + 1, x]]
    order = across.shape[1]
    for y in range(y0, y1):
        for x in range(max(0, x0 - order + 1), min(x1, width - order + 1)):
            best = np.float32(3e38)
            for r in range(across.shape[0]):
                total = np.float32(0.0)
                for k in range(order):
                    total += distance[kind[tiles[y, x + k]], across[r, k]]
                    if total >= best:
                        break
                best = min(best, total)
            cost[2, y, x] = best * scale_right
    order = down.shape[1]
    for y in range(max(0, y0 - order + 1), min(y1, height - order + 1)):
        for x in range(x0, x1):
            best = np.float32(3e38)
            for r in range(down.shape[0]):
                total = np.float32(0.0)
                for k in range(order):
                    total += distance[kind[tiles[y + k, x]], down[r, k]]
                    if total >= best:
                        break
                best = min(best, total)
            cost[3, y, x] = best * scale_below


@njit(cache=True)
def sum_costs(cost: Float64Array) -> float:
    """Sum in a fixed order, so that incremental and full energies have the same bits."""
    out = 0.0
    for term in range(cost.shape[0]):
        for y in range(cost.shape[1]):
            for x in range(cost.shape[2]):
                out += cost[term, y, x]
    return out
