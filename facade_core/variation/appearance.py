"""How a group's patches look: the principal components that the file keeps, and what it costs to show one type for another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Principal components kept (d in the paper).
DIMENSIONS = 7


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
    keep = np.argsort(-values, kind="stable")[: min(DIMENSIONS, len(flat) - 1)]
    keep = keep[values[keep] > 0.25 * flat.shape[1]]
    axes = (vectors[:, keep].T @ (flat - mean)) / np.sqrt(values[keep])[:, None]
    strongest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], 1)
    axes = (axes * np.where(strongest < 0, -1, 1)).reshape(-1, *patches.shape[1:])
    return Basis(mean.reshape(patches.shape[1:]).astype(np.float32), axes.astype(np.float32))


def relabelling_cost(representatives: np.ndarray) -> np.ndarray:
    """(T, T) cost C of relabelling one type as another: SSD of (T, h, w, 3) representatives, cubed, largest 1."""
    flat = representatives.reshape(len(representatives), -1).astype(np.float64)
    ssd = np.array([((flat - one) ** 2).sum(axis=1) for one in flat]).reshape(len(flat), len(flat))
    return (ssd / max(ssd.max(), 1e-12)) ** 3
