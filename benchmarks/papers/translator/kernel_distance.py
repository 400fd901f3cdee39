"""Kernel distance between sets of pictures, by features of an ImageNet network.

Needs the `train` extra.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array

if TYPE_CHECKING:
    from training.parser.network import ParserNetwork

# Blocks of EfficientNet-Lite0 with strides 4, 8, 16 and 32, whose mean outputs are the features.
FEATURE_BLOCKS = (2, 4, 10, 15)


@lru_cache(maxsize=1)
def load_feature_network() -> ParserNetwork:
    from training.parser.network import ParserNetwork

    network = ParserNetwork()
    network.load_imagenet_weights()
    network.eval()
    return network


def image_features(pictures: Sequence[UInt8Array]) -> Float64Array:
    """Compute features of pictures: mean outputs of FEATURE_BLOCKS at unit length.

    Parameters
    ----------
    pictures : (h, w, 3) uint8 each.

    Returns
    -------
    (n, 496) float64.
    """
    import torch
    from torch.nn import functional

    network, features = load_feature_network(), []
    for picture in pictures:
        x = torch.from_numpy(np.ascontiguousarray(picture)).permute(2, 0, 1)[None].float()
        means = []
        with torch.no_grad():
            x = functional.relu6(network.stem((x - 127.0) / 128.0))
            for number, block in enumerate(network.blocks):
                x = block(x)
                if number in FEATURE_BLOCKS:
                    mean = x.mean((2, 3))[0]
                    means.append(mean / mean.norm().clamp_min(1e-6))
        features.append(torch.cat(means).double().numpy())
    return np.array(features)


def kernel_distance(ours: Float64Array, theirs: Float64Array) -> float:
    """Compute the unbiased squared maximum mean discrepancy under the kernel (x . y + 1)^3.

    Parameters
    ----------
    ours : (n, k) features.
    theirs : (m, k) features.
    """

    def kernel(a: Float64Array, b: Float64Array) -> Float64Array:
        return (a @ b.T + 1) ** 3

    n, m = len(ours), len(theirs)
    within, other = kernel(ours, ours), kernel(theirs, theirs)
    np.fill_diagonal(within, 0)
    np.fill_diagonal(other, 0)
    return float(within.sum() / (n * (n - 1)) + other.sum() / (m * (m - 1)) - 2 * kernel(ours, theirs).mean())
