"""Joining a cloned patch to what is there: where the seam runs, and how colours meet."""

from __future__ import annotations

import cv2
import numpy as np

_DEEP = 1e6


def seam(old: np.ndarray, new: np.ndarray, must_old: np.ndarray, must_new: np.ndarray) -> np.ndarray:
    """Where to show `new` instead of `old` (both (h, w, 3) float32), by a graph cut: (h, w) bool.

    Only a smoothness term (floors paper, section 3.2.2): a cut between neighbours p, q costs the differences of the
    two pictures at p and q. must_old and must_new (h, w) bool hold the two sides fixed.
    """
    import maxflow

    differ = np.abs(old - new).sum(2).astype(np.float64) + 1.0
    graph = maxflow.GraphFloat(differ.size, 2 * differ.size)
    nodes = graph.add_grid_nodes(differ.shape)
    right = np.zeros_like(differ)
    right[:, :-1] = differ[:, :-1] + differ[:, 1:]
    below = np.zeros_like(differ)
    below[:-1] = differ[:-1] + differ[1:]
    graph.add_grid_edges(nodes, right, np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]]), symmetric=True)
    graph.add_grid_edges(nodes, below, np.array([[0, 0, 0], [0, 0, 0], [0, 1, 0]]), symmetric=True)
    graph.add_grid_tedges(nodes, np.where(must_new, 0.0, must_old * _DEEP), np.where(must_new, _DEEP, 0.0))
    graph.maxflow()
    return graph.get_grid_segments(nodes)


def level(difference: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Spread colour differences known on a rim smoothly over everything: (h, w, 3) float32.

    difference (h, w, 3) counts where weight (h, w) is above 0. A membrane by normalised convolution: near the rim its
    local mean, far from it the mean over an ever wider part of it. Differences are clipped, so that one misplaced edge
    does not bleed into the patch.
    """
    weight = weight.astype(np.float32)
    clipped = np.clip(difference, -48.0, 48.0) * weight[..., None]
    extent = float(max(difference.shape[:2]))
    sums, shares = np.zeros_like(clipped), np.zeros_like(weight)
    for sigma, share in ((4.0, 1.0), (16.0, 0.1), (max(48.0, extent / 2), 0.01)):
        sums += share * _blur(clipped, sigma)
        shares += share * _blur(weight, sigma)
    return sums / np.maximum(shares, 1e-6)[..., None]


def _blur(array: np.ndarray, sigma: float) -> np.ndarray:
    """Gaussian blur that shrinks the array first where sigma is large; zero outside."""
    factor = max(1, int(sigma // 4))
    height, width = array.shape[:2]
    small = cv2.resize(array, (-(-width // factor), -(-height // factor)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_CONSTANT)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
