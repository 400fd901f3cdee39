"""What it costs to show one type of elements for another, by how their projected patches look."""

from __future__ import annotations

import numpy as np

# Principal components kept (d in the paper).
PRINCIPAL_COMPONENTS = 7


def project_patches(patches: np.ndarray) -> np.ndarray:
    """(N, d <= 7) coordinates of (N, h, w, 3) patches in their principal components, in intensities."""
    flat = patches.reshape(len(patches), -1).astype(np.float64)
    flat -= flat.mean(axis=0)
    values, vectors = np.linalg.eigh(flat @ flat.T)
    return (vectors * np.sqrt(np.maximum(values, 0)))[:, ::-1][:, :PRINCIPAL_COMPONENTS]


def relabelling_cost(representatives: np.ndarray) -> np.ndarray:
    """(T, T) cost C of relabelling one type as another: SSD of (T, d) representatives, cubed, largest 1."""
    ssd = np.array([((representatives - one) ** 2).sum(axis=1) for one in representatives])
    ssd = ssd.reshape(len(representatives), len(representatives))
    return (ssd / max(ssd.max(initial=0), 1e-12)) ** 3
