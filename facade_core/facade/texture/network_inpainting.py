"""Inpainting of hidden parts by LaMa, a network that a user gives.

References
----------
Suvorov et al. 2022, Resolution-robust large mask inpainting with Fourier convolutions.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.external_network import REMEDY, ExternalNetwork, open_network
from facade_core.core.model_file import file_stamps

# Sides of a picture are multiples of this, where the network leaves them free,
_STRIDE = 8
# and at most so long, which bounds time and memory. Larger crops are reduced.
_MAX_FREE_SIDE = 1024
# A crop is at least so many times as long as the hole in it: the network needs what is around.
_CONTEXT = 2
# Mean output of a grey picture, as a share of white.
_GREY_RANGE = (0.2, 0.8)


@dataclass(frozen=True, slots=True)
class InpaintingNetwork:
    """Network that fills the hidden part of a picture.

    Attributes
    ----------
    network : the network.
    highest : value of white in its output.
    """

    network: ExternalNetwork
    highest: float

    @property
    def max_size(self) -> tuple[int, int]:
        """Return the largest height and width of a picture in pixels."""
        return self.network.size or (_MAX_FREE_SIDE, _MAX_FREE_SIDE)

    def fill(self, image: UInt8Array, hidden: BoolArray) -> UInt8Array:
        """Return an image (h, w, 3) uint8 with its hidden part (h, w) bool filled; its visible part may differ too."""
        import cv2

        height, width = hidden.shape
        scale = min(1.0, *(most / side for most, side in zip(self.max_size, hidden.shape, strict=True)))
        rows, columns = (max(1, round(side * scale)) for side in hidden.shape)
        small, mask = image, hidden.astype(np.float32)
        if scale < 1:
            small = np.asarray(cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
            mask = np.asarray(cv2.resize(mask, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)
        size = self.network.size or (rows + -rows % _STRIDE, columns + -columns % _STRIDE)
        pad = ((0, size[0] - rows), (0, size[1] - columns))
        filled = _run(
            self.network, np.pad(small, (*pad, (0, 0)), mode="symmetric"), np.pad(mask > 0, pad, mode="symmetric")
        )[:rows, :columns]
        levels = np.rint(np.clip(filled * (255 / self.highest), 0, 255)).astype(np.uint8)
        return np.asarray(cv2.resize(levels, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def load_inpainting_network(path: Path) -> InpaintingNetwork:
    """Load LaMa from an .onnx file.

    Raises
    ------
    ModelFileError
        If the file cannot be used.
    """
    return _cached_network(path.resolve(), file_stamps(path, has_record=False))


@functools.lru_cache(maxsize=2)
def _cached_network(path: Path, _stamps: tuple[tuple[int, int], ...]) -> InpaintingNetwork:
    network = open_network(path, {"image": 3, "mask": 1})
    grey = np.full((*(network.size or (256, 256)), 3), 128, np.uint8)
    hole = np.zeros(grey.shape[:2], bool)
    hole[: len(hole) // 4] = True
    mean = float(_run(network, grey, hole).mean())
    for highest in (1.0, 255.0):
        if _GREY_RANGE[0] <= mean / highest <= _GREY_RANGE[1]:
            return InpaintingNetwork(network, highest)
    raise ModelFileError(f"{path}: makes {mean:.2f} of a grey picture, not about .5 or 128; {REMEDY}")


def _run(network: ExternalNetwork, image: UInt8Array, hidden: BoolArray) -> Float32Array:
    """Run a network on an image (h, w, 3) uint8 and its hidden part; returns (h, w, 3) float32."""
    planes = np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32) / np.float32(255)
    (name, filled), *_ = network.run(image=planes, mask=hidden[None, None].astype(np.float32)).items()
    if filled.shape != planes.shape:
        raise ModelFileError(f"{network.path}: its output {name} is {filled.shape}, not {planes.shape}; {REMEDY}")
    return np.ascontiguousarray(filled[0].transpose(1, 2, 0), np.float32)


def fill_by_network(image: UInt8Array, mask: BoolArray, network: InpaintingNetwork) -> UInt8Array:
    """Fill hidden pixels by a network, crop by crop, the largest hole first; all other pixels keep their bits.

    A crop holds a hole with its surroundings, at the picture's own scale where the network's size allows. It fills every
    hole that lies in it as a whole.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where to fill.
    network : the network.

    Returns
    -------
    (H, W, 3) uint8.
    """
    import cv2

    result, missing = image.copy(), mask.copy()
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    low, high = boxes[:, [1, 0]], boxes[:, [1, 0]] + boxes[:, [3, 2]]
    is_open = np.arange(len(boxes)) > 0  # the first part is what is visible
    for hole in np.argsort(-boxes[:, cv2.CC_STAT_AREA], kind="stable"):
        if not is_open[hole]:
            continue
        longest = _CONTEXT * (high[hole] - low[hole]).max()
        size = np.minimum(np.maximum(network.max_size, longest), mask.shape)
        start = np.clip((low[hole] + high[hole] - size) // 2, 0, mask.shape - size)
        crop = tuple(slice(int(a), int(a + side)) for a, side in zip(start, size, strict=True))
        inside = is_open & (low >= start).all(axis=1) & (high <= start + size).all(axis=1)
        filled, own = network.fill(result[crop], missing[crop]), inside[parts[crop]]
        result[crop] = np.where(own[..., None], filled, result[crop])
        missing[crop] &= ~own
        is_open &= ~inside
    return result
