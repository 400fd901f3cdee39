"""Element types: descriptors of patches that are invariant to light, clustered by mean shift."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, IntArray
from facade_core.core.fixed_order import multiply_matrices, principal_coordinates
from facade_core.core.numba_cache import njit
from facade_core.core.ties import ROUNDING_SHARE, first_minimum
from facade_core.facade.variation.appearance import PRINCIPAL_COMPONENTS

# Longest side of a descriptor: a state is still recognisable there although a box is a pixel off.
_DESCRIPTOR_SIDE_PX = 12
# Weights of colours and edges; a shadow changes colours, but hardly edges.
_COLOUR_WEIGHT = 0.5
_EDGE_WEIGHT = 480.0
# Gradient of noise, grey levels for each pixel.
_NOISE_GRADIENT = 8.0
# Candidate kernel widths, root mean square per value of a descriptor.
_KERNEL_WIDTHS = np.geomspace(6, 100, 20)
# Kernel width if no candidate separates types: a share of the median distance, at least the noise in pictures of one
# state.
_FALLBACK_WIDTH_SHARE = 0.8
_MIN_FALLBACK_WIDTH = 40.0
# Smallest mean silhouette of types, and of the split of a type.
_MIN_SILHOUETTE = 0.2
_MIN_SPLIT_SILHOUETTE = 0.6
# Smallest gain of the silhouette for more types.
_MIN_SILHOUETTE_GAIN = 0.08
# Smallest number of elements of a type that is split.
_MIN_SPLIT_SIZE = 5
# Squared distances below this are rounding where all points are equal.
_MIN_SQUARED_DISTANCE = 1e-12


def compute_descriptors(patches: Float32Array, visible: BoolArray) -> Float64Array:
    """Compute descriptors of patches from colours and edges at a small size.

    An edge is a gradient relative to the root mean square gradient around it, so that darker or paler pictures of one
    state have the same edges. Hidden pixels take the values of the most similar patch that shows them.

    Parameters
    ----------
    patches : (N, h, w, 3).
    visible : (N, h, w) bool, False where another element hides the patch.

    Returns
    -------
    (N, d) principal coordinates as root mean square per value, d at most PRINCIPAL_COMPONENTS.
    """
    import cv2

    height, width = patches.shape[1:3]
    scale = min(1.0, _DESCRIPTOR_SIDE_PX / max(height, width))
    size = max(4, round(width * scale)), max(4, round(height * scale))
    around = max(3, width // 2), max(3, height // 2)
    values = np.empty((len(patches), size[1], size[0], 5), np.float32)
    known = np.empty((len(patches), size[1], size[0]), bool)
    for patch, in_view, value, whole in zip(patches, visible, values, known, strict=True):
        grey = patch.mean(axis=2)
        across, down = cv2.Sobel(grey, -1, 1, 0, scale=1 / 8), cv2.Sobel(grey, -1, 0, 1, scale=1 / 8)
        # A running sum in single precision can be negative next to a flat part.
        usual = np.sqrt(np.maximum(cv2.blur(across * across + down * down, around), 0)) + _NOISE_GRADIENT
        value[..., :3] = _COLOUR_WEIGHT * cv2.resize(patch, size, interpolation=cv2.INTER_AREA)
        value[..., 3] = cv2.resize(_EDGE_WEIGHT * np.abs(across) / usual, size, interpolation=cv2.INTER_AREA)
        value[..., 4] = cv2.resize(_EDGE_WEIGHT * np.abs(down) / usual, size, interpolation=cv2.INTER_AREA)
        whole[:] = cv2.resize(in_view.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.9
    flat = fill_unknown_from_similar(values, known).reshape(len(patches), -1).astype(np.float64)
    descriptors: Float64Array = principal_coordinates(flat, PRINCIPAL_COMPONENTS) / np.sqrt(flat.shape[1])
    return descriptors


def fill_unknown_from_similar(values: Float32Array, known: BoolArray) -> Float32Array:
    """Fill unknown values from the most similar item that knows them.

    Similarity is measured where both items are known. Values that no item knows stay.

    Parameters
    ----------
    values : (N, h, w, c).
    known : (N, h, w) bool.

    Returns
    -------
    (N, h, w, c).
    """
    if known.all():
        return values
    flat = np.where(known[..., None], values, 0).reshape(len(values), -1).astype(np.float64)
    weight = np.repeat(known.reshape(len(values), -1), values.shape[-1], axis=1).astype(np.float64)
    partial = np.flatnonzero(~known.all(axis=(1, 2)))
    common = multiply_matrices(weight[partial], weight.T)
    squares = multiply_matrices(flat[partial] ** 2, weight.T) + multiply_matrices(flat * flat, weight[partial].T).T
    products = multiply_matrices(flat[partial], flat.T)
    apart = np.where(common > 0, (squares - 2 * products) / np.maximum(common, 1), np.inf)
    result = values.copy()
    for i, own_apart in zip(partial, apart, strict=True):
        missing = ~known[i]
        for j in np.argsort(own_apart, kind="stable"):
            here = missing & known[j]
            result[i][here] = values[j][here]
            missing &= ~here
            if not missing.any():
                break
    return result


def cluster_types(points: Float64Array) -> tuple[Int32Array, Int32Array]:
    """Cluster descriptors to element types by mean shift.

    The paper's kernel has one width for all facades. Here the width is the one whose types are separated best (mean
    silhouette), if any separates them: drawn curtains differ by less than photographs of one state.

    Parameters
    ----------
    points : (N, d) descriptors.

    Returns
    -------
    (N,) int32 types, the most frequent first, and (T,) int32 representatives, the elements nearest to the centroids.
    """
    types = order_by_frequency(_separate_types(np.ascontiguousarray(points, np.float64), _MIN_SILHOUETTE))
    return types, choose_representatives(points, types)


def choose_representatives(points: Float64Array, types: Int32Array) -> Int32Array:
    """Return the (T,) element of each type that is nearest to the centroid of its points (N, d).

    Both members of a pair are equally near; the first represents it.
    """
    representatives = np.empty(types.max(initial=-1) + 1, np.int32)
    for t in range(len(representatives)):
        members = np.flatnonzero(types == t)
        to_centroid = ((points[members] - points[members].mean(axis=0)) ** 2).sum(axis=1)
        scale = float((points[members] ** 2).sum(axis=1).max())
        tolerance = ROUNDING_SHARE * scale + _MIN_SQUARED_DISTANCE
        representatives[t] = members[first_minimum(to_centroid, tolerance)]
    return representatives


def _separate_types(points: Float64Array, clear: float) -> IntArray:
    """Cluster with the best kernel width, then split each type while that separates better.

    Without the second step one unusual kind of window, such as dormers, would hide the states of all others.
    """
    apart = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))[np.triu_indices(len(points), 1)]
    types, best = (
        mean_shift(
            points,
            max(_MIN_FALLBACK_WIDTH, _FALLBACK_WIDTH_SHARE * float(np.median(apart)))
            if len(apart)
            else _MIN_FALLBACK_WIDTH,
        ),
        clear,
    )
    for width in _KERNEL_WIDTHS[::-1]:
        found = mean_shift(points, width)
        score = mean_silhouette(points, found)
        if score > best + _MIN_SILHOUETTE_GAIN:
            types, best = found, score
    if types.max(initial=0) == 0:
        return types
    parts = np.zeros_like(types)
    for t in range(types.max() + 1):
        members = types == t
        if members.sum() >= _MIN_SPLIT_SIZE:
            parts[members] = _separate_types(points[members], _MIN_SPLIT_SILHOUETTE)
    separated: IntArray = np.unique(types * (len(types) + 1) + parts, return_inverse=True)[1]
    return separated


def order_by_frequency(types: IntArray) -> Int32Array:
    """Renumber labels (N,) by descending frequency, then by first occurrence."""
    _, first, index, counts = np.unique(types, return_index=True, return_inverse=True, return_counts=True)
    return np.argsort(np.lexsort((first, -counts)))[index].astype(np.int32)


def mean_shift(points: Float64Array, width: float) -> Int32Array:
    """Cluster points with a flat kernel; modes closer than its radius merge.

    Parameters
    ----------
    points : (N, d).
    width : radius of the kernel.

    Returns
    -------
    (N,) int32 clusters, the largest first.
    """
    modes: Int32Array = _find_modes(np.ascontiguousarray(points, np.float64), float(width))
    return modes


@njit(cache=True)
def _find_modes(points: Float64Array, width: float) -> Int32Array:
    """Assign points to the best supported mode that theirs meets; number clusters by size, then by first point."""
    number, dimensions = points.shape
    modes = points.copy()
    support = np.zeros(number, np.int64)
    total = np.empty(dimensions)
    for i in range(number):
        for _ in range(100):
            for k in range(dimensions):
                total[k] = 0.0
            support[i] = 0
            for j in range(number):
                if _squared_distance(modes[i], points[j]) <= width * width:
                    for k in range(dimensions):
                        total[k] += points[j, k]
                    support[i] += 1
            moved = 0.0
            for k in range(dimensions):
                mean = total[k] / support[i]
                moved = max(moved, abs(mean - modes[i, k]))
                modes[i, k] = mean
            if moved < 1e-3 * width:
                break
    label = np.full(number, -1, np.int32)
    for _ in range(number):
        best = -1
        for i in range(number):
            if label[i] < 0 and (best < 0 or support[i] > support[best]):
                best = i
        if best < 0:
            break
        for i in range(number):
            if label[i] < 0 and _squared_distance(modes[i], modes[best]) <= width * width:
                label[i] = best
    counts = np.zeros(number, np.int64)
    for i in range(number):
        counts[label[i]] += 1
    # A cluster's number is the count of larger clusters and of earlier ones of equal size.
    names = np.empty(number, np.int32)
    for i in range(number):
        names[i] = 0
        for j in range(number):
            names[i] += counts[j] > counts[label[i]] or (counts[j] == counts[label[i]] and j < label[i])
    return names


@njit(cache=True)
def _squared_distance(one: Float64Array, other: Float64Array) -> float:
    """Return the squared distance of two points."""
    total = 0.0
    for k in range(len(one)):
        total += (one[k] - other[k]) ** 2
    return total


@njit(cache=True)
def mean_silhouette(points: Float64Array, types: Int32Array) -> float:
    """Return the mean silhouette; elements alone in their type count 0, and so does a single type.

    Parameters
    ----------
    points : (N, d).
    types : (N,) 0, 1 ...
    """
    number = len(points)
    kinds = 0
    for kind in types:
        kinds = max(kinds, kind + 1)
    if kinds < 2:
        return 0.0
    counts = np.zeros(kinds, np.int64)
    for kind in types:
        counts[kind] += 1
    total = 0.0
    sums = np.empty(kinds)
    for i in range(number):
        if counts[types[i]] < 2:
            continue
        for t in range(kinds):
            sums[t] = 0.0
        for j in range(number):
            sums[types[j]] += np.sqrt(_squared_distance(points[i], points[j]))
        within = sums[types[i]] / (counts[types[i]] - 1)
        other = np.inf
        for t in range(kinds):
            if t != types[i]:
                other = min(other, sums[t] / counts[t])
        total += (other - within) / max(within, other, 1e-12)
    return total / number
