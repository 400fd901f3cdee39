"""Types of elements: principal components of a group's patches and mean-shift clusters among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Dimensions kept (d in the paper) and the kernel width as a share of the intensity range, root mean square per value.
_DIMENSIONS = 7
_KERNEL_WIDTH = 0.1
_FACTORS = (1.0, 1.2, 1.45, 0.8, 0.65, 0.5, 0.4, 0.3, 0.22)
# Mean silhouette from which types other than those of the paper's kernel are believed.
_CLEAR = 0.2
# The same for a type's own elements, of which there must be a few.
_CLEARER = 0.6
_SMALLEST_SPLIT = 5


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """mean (h, w, 3) and axes (d, h, w, 3) float32, in intensities; an element's patch is mean + coordinates . axes."""

    mean: np.ndarray
    axes: np.ndarray

    def project(self, patches: np.ndarray) -> np.ndarray:
        """(N, d) coordinates of (N, h, w, 3) patches, by least squares: the axes need not be orthonormal."""
        if not len(self.axes):
            return np.zeros((len(patches), 0))
        axes = self.axes.reshape(len(self.axes), -1).astype(np.float64)
        centred = (patches - self.mean).reshape(len(patches), -1).astype(np.float64)
        return np.linalg.solve(axes @ axes.T, axes @ centred.T).T

    def patches(self, coordinates: np.ndarray) -> np.ndarray:
        """(N, h, w, 3) patches of (N, d) coordinates."""
        return self.mean + np.tensordot(coordinates, self.axes, 1).astype(np.float32)


def principal_components(patches: np.ndarray) -> Basis:
    """The mean and up to 7 orthonormal axes of (N, h, w, 3) patches, strongest first, sign fixed."""
    flat = patches.reshape(len(patches), -1).astype(np.float64)
    mean = flat.mean(axis=0)
    values, vectors = np.linalg.eigh((flat - mean) @ (flat - mean).T)
    # Less than half a grey level per value is not worth an axis.
    keep = np.argsort(-values, kind="stable")[: min(_DIMENSIONS, len(flat) - 1)]
    keep = keep[values[keep] > 0.25 * flat.shape[1]]
    axes = (vectors[:, keep].T @ (flat - mean)) / np.sqrt(values[keep])[:, None]
    strongest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], 1)
    axes = (axes * np.where(strongest < 0, -1, 1)).reshape(-1, *patches.shape[1:])
    return Basis(mean.reshape(patches.shape[1:]).astype(np.float32), axes.astype(np.float32))


def cluster(coordinates: np.ndarray, values: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean-shift types of (N, d) coordinates of patches with `values` numbers each.

    Returns (N,) int32 types, the most frequent first, and (T,) int32 the representative of each: the element nearest to
    its centroid. The kernel is 0.1 of the intensity range wide in root mean square per value, the reading of the
    paper's "0.1 of the size of element" that does not depend on the resolution. Narrower and wider kernels are tried
    too, and the one whose types lie apart most clearly (mean silhouette) is taken when they are clear at all: half-drawn
    curtains differ by less than the paper's kernel, photographed windows of one state by more.
    """
    points = coordinates / (255 * np.sqrt(values))
    types = _ordered(_separate(points, _CLEAR))
    representatives = np.empty(types.max(initial=-1) + 1, np.int32)
    for t in range(len(representatives)):
        members = np.flatnonzero(types == t)
        to_centroid = ((points[members] - points[members].mean(axis=0)) ** 2).sum(axis=1)
        representatives[t] = members[to_centroid.argmin()]
    return types, representatives


def _separate(points: np.ndarray, clear: float) -> np.ndarray:
    """Types by the clearest kernel, each type then separated further while that is clearer still.

    Without the second step one odd kind of window, say the dormers, hides the states of all others.
    """
    distance = np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2))
    types, best = mean_shift(points, _KERNEL_WIDTH), clear
    for factor in _FACTORS:
        found = mean_shift(points, factor * _KERNEL_WIDTH)
        score = silhouette(distance, found)
        if score > best:
            types, best = found, score
    if types.max(initial=0) == 0:
        return types
    parts = np.zeros_like(types)
    for t in range(types.max() + 1):
        members = types == t
        if members.sum() >= _SMALLEST_SPLIT:
            parts[members] = _separate(points[members], _CLEARER)
    return np.unique(types * (len(types) + 1) + parts, return_inverse=True)[1]


def _ordered(types: np.ndarray) -> np.ndarray:
    """(N,) int32: the labels renumbered, the most frequent first, then the first to appear."""
    _, first, index, counts = np.unique(types, return_index=True, return_inverse=True, return_counts=True)
    return np.argsort(np.lexsort((first, -counts)))[index].astype(np.int32)


def mean_shift(points: np.ndarray, width: float) -> np.ndarray:
    """(N,) int32 clusters of (N, d) points, the largest first: flat kernel of radius `width`, modes closer than that one.

    All points climb at once, which for the few elements of a facade takes a hundredth of a general implementation's time.
    """
    modes = points.copy()
    for _ in range(100):
        near = (((modes[:, None] - points[None]) ** 2).sum(axis=2) <= width**2).astype(float)
        moved = near @ points / near.sum(axis=1, keepdims=True)
        if np.abs(moved - modes).max(initial=0) < 1e-3 * width:
            break
        modes = moved
    support = near.sum(axis=1)
    label = np.full(len(points), -1, np.int32)
    for i in np.lexsort((np.arange(len(points)), -support)):
        if label[i] < 0:
            close = ((modes - modes[i]) ** 2).sum(axis=1) <= width**2
            label[close & (label < 0)] = i
    return _ordered(label)


def silhouette(distance: np.ndarray, types: np.ndarray) -> float:
    """Mean silhouette of (N,) types given (N, N) distances; elements alone in their type, or a single type, count 0."""
    member = (types[:, None] == np.arange(types.max() + 1)).astype(float)
    counts = member.sum(axis=0)
    if len(counts) < 2:
        return 0.0
    sums = distance @ member
    own = counts[types]
    within = sums[np.arange(len(types)), types] / np.maximum(own - 1, 1)
    other = np.where(member > 0, np.inf, sums / counts).min(axis=1)
    width = np.maximum(np.maximum(within, other), 1e-12)
    return float(np.where(own > 1, (other - within) / width, 0).mean())


def relabelling_cost(representatives: np.ndarray) -> np.ndarray:
    """(T, T) cost C of relabelling one type as another: SSD of (T, h, w, 3) representatives, cubed, largest 1."""
    flat = representatives.reshape(len(representatives), -1).astype(np.float64)
    ssd = ((flat[:, None] - flat[None]) ** 2).sum(axis=2)
    return (ssd / max(ssd.max(), 1e-12)) ** 3
