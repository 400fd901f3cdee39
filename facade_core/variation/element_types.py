"""Types of elements: principal components of a group's patches and mean-shift clusters among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Dimensions kept (d in the paper) and the kernel width as a share of the intensity range, root mean square per value.
_DIMENSIONS = 7
_KERNEL_WIDTH = 0.1


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
    paper's "0.1 of the size of element" that does not depend on the resolution.
    """
    if not coordinates.shape[1]:
        return np.zeros(len(coordinates), np.int32), np.zeros(1, np.int32)
    from sklearn.cluster import MeanShift

    found = MeanShift(bandwidth=_KERNEL_WIDTH * 255 * np.sqrt(values)).fit(coordinates).labels_
    _, first, found, counts = np.unique(found, return_index=True, return_inverse=True, return_counts=True)
    order = np.lexsort((first, -counts))
    types = np.argsort(order)[found].astype(np.int32)
    representatives = np.empty(len(order), np.int32)
    for t in range(len(order)):
        members = np.flatnonzero(types == t)
        distance = ((coordinates[members] - coordinates[members].mean(axis=0)) ** 2).sum(axis=1)
        representatives[t] = members[distance.argmin()]
    return types, representatives


def relabelling_cost(representatives: np.ndarray) -> np.ndarray:
    """(T, T) cost C of relabelling one type as another: SSD of (T, h, w, 3) representatives, cubed, largest 1."""
    flat = representatives.reshape(len(representatives), -1).astype(np.float64)
    ssd = ((flat[:, None] - flat[None]) ** 2).sum(axis=2)
    return (ssd / max(ssd.max(), 1e-12)) ** 3
