"""Distance of features of an EfficientNet-Lite0 trained on ImageNet (extra: train)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.papers.translator.kernel_distance import load_feature_network

if TYPE_CHECKING:
    import torch

# Blocks whose outputs are features, of strides 2 to 32.
BLOCKS = (0, 2, 4, 10, 15)


def perceptual_distance(result: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """Sum over BLOCKS the mean squared difference of unit-length features inside a mask.

    Parameters
    ----------
    result, truth : (H, W, 3) uint8.
    mask : (H, W) bool.
    """
    import torch
    from torch.nn import functional

    inside = torch.from_numpy(mask)[None, None].float()
    total = 0.0
    for a, b in zip(_features(result), _features(truth), strict=True):
        share = functional.adaptive_avg_pool2d(inside, tuple(a.shape[1:]))[0, 0]
        total += float((((a - b) ** 2).sum(0) * share).sum() / share.sum())
    return total


def _features(image: np.ndarray) -> Sequence[torch.Tensor]:
    """Compute features (channels, h, w) of unit length after each of BLOCKS."""
    import torch
    from torch.nn import functional

    network, found = load_feature_network(), []
    with torch.no_grad():
        x = torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1)[None].float()
        x = functional.relu6(network.stem((x - 127.0) / 128.0))
        for number, block in enumerate(network.blocks):
            x = block(x)
            if number in BLOCKS:
                found.append(x[0] / x[0].norm(dim=0, keepdim=True).clamp_min(1e-6))
    return found
