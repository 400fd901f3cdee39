"""Semantic segmentation by a network that a user gives: what is in front of a wall, and what is outside the facade."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import special

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.external_network import REMEDY, ExternalNetwork, open_network
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.model_file import file_stamps
from facade_core.parsing.network import COARSEST_STRIDE, Network
from facade_core.parsing.segmentation import Segmentation
from facade_core.parsing.semantic_classes import CLASSES_BY_COUNT, DATA_SETS, SemanticClasses

# Outputs of SegFormer and the like, and of Mask2Former, MaskFormer and OneFormer.
_LOGITS, _CLASS_QUERIES, _MASK_QUERIES = "logits", "class_queries_logits", "masks_queries_logits"
# Means and deviations of ImageNet, with which the image processors of these networks standardise pictures in 0 to 1.
_MEAN = np.array([0.485, 0.456, 0.406], np.float32)
_DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)
# Pixels of a picture for a network of free size: the largest crops of ADE20K that SegFormer was trained on.
_FREE_AREA = 640 * 640


@dataclass(frozen=True, slots=True)
class SemanticNetwork:
    """Network of semantic segmentation, and the classes of its data set."""

    network: ExternalNetwork
    classes: SemanticClasses

    def segment(self, image: UInt8Array) -> tuple[Float32Array, Float32Array]:
        """Return the probabilities (H, W) of an occluder, and of what is outside, for an image (H, W, 3) uint8."""
        import cv2

        height, width = image.shape[:2]
        scale = math.sqrt(_FREE_AREA / (height * width))
        free = [COARSEST_STRIDE * max(1, round(side * scale / COARSEST_STRIDE)) for side in (height, width)]
        rows, columns = self.network.size or free
        mode = cv2.INTER_AREA if rows * columns < height * width else cv2.INTER_LINEAR
        view = np.asarray(cv2.resize(image, (columns, rows), interpolation=mode), np.uint8)
        outputs = _run(self.network, view)
        occluder, outside = (
            np.asarray(cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
            for plane in _role_probabilities(outputs, self.classes)
        )
        return occluder, outside


@dataclass(frozen=True, slots=True)
class OccluderSegmenter:
    """Parser whose occluders come from a semantic network, which also adds to what is outside."""

    parser: Network
    semantic: SemanticNetwork

    @property
    def working_area(self) -> tuple[int, int]:
        """Return the working area of the parser."""
        return self.parser.working_area

    def segment(self, image: UInt8Array) -> Segmentation:
        """Segment an image (H, W, 3) uint8."""
        parsed = self.parser.segment(image)
        occluder, outside = self.semantic.segment(image)
        return Segmentation(parsed.confidence, occluder, np.maximum(parsed.outside, outside))


def load_semantic_network(path: Path) -> SemanticNetwork:
    """Load a network of semantic segmentation; the number of its classes tells the data set.

    Raises
    ------
    ModelFileError
        If the file cannot be used.
    """
    return _cached_network(path.resolve(), file_stamps(path, has_record=False))


@functools.lru_cache(maxsize=2)
def _cached_network(path: Path, _stamps: tuple[tuple[int, int], ...]) -> SemanticNetwork:
    network = open_network(path, {"pixel_values": 3})
    outputs = _run(network, np.zeros((*(network.size or (256, 256)), 3), np.uint8))
    count = _count_classes(outputs)
    if count is None:
        found = ", ".join(f"{name} {value.shape} {value.dtype}" for name, value in outputs.items())
        raise ModelFileError(
            f"{path}: its outputs are {found}, not {_LOGITS} (1, C, h, w), or {_CLASS_QUERIES} (1, Q, C + 1) and "
            f"{_MASK_QUERIES} (1, Q, h, w), finite float32; {REMEDY}"
        )
    if count not in CLASSES_BY_COUNT:
        raise ModelFileError(f"{path}: has {count} classes; give a network of {DATA_SETS}")
    return SemanticNetwork(network, CLASSES_BY_COUNT[count])


def _count_classes(outputs: Mapping[str, Float32Array]) -> int | None:
    """Return the number of classes in the outputs of a network; None where these are others."""
    names = [_CLASS_QUERIES, _MASK_QUERIES] if outputs.keys() >= {_CLASS_QUERIES, _MASK_QUERIES} else [_LOGITS]
    used = [outputs[name] for name in names if name in outputs]
    if not used or any(value.dtype != np.float32 or not np.isfinite(value).all() for value in used):
        return None
    if used[-1].ndim != 4:
        return None
    if len(used) == 1:
        return int(used[0].shape[1])
    return int(used[0].shape[2]) - 1 if used[0].ndim == 3 and used[0].shape[1] == used[1].shape[1] else None


def _run(network: ExternalNetwork, image: UInt8Array) -> dict[str, Float32Array]:
    """Run a network on an image (H, W, 3) uint8."""
    values = (image.astype(np.float32) / np.float32(255) - _MEAN) / _DEVIATION
    return network.run(pixel_values=np.ascontiguousarray(values.transpose(2, 0, 1)[None], np.float32))


def _role_probabilities(outputs: dict[str, Float32Array], classes: SemanticClasses) -> Float32Array:
    """Return the probability of occluders and of what is outside, (2, h, w) float32."""
    roles = (list(classes.occluders), list(classes.outside))
    if _CLASS_QUERIES not in outputs:
        shares = special.softmax(outputs[_LOGITS][0], axis=0)
        return np.stack([shares[role].sum(axis=0) for role in roles])
    queries = special.softmax(outputs[_CLASS_QUERIES][0], axis=1)[:, :-1].T  # without "no object"
    masks = special.expit(outputs[_MASK_QUERIES][0])
    weights = np.stack([*(queries[role].sum(axis=0) for role in roles), queries.sum(axis=0)])
    *found, every = multiply_matrices(weights, masks.reshape(len(masks), -1)).reshape(3, *masks.shape[1:])
    return np.asarray(np.stack(found) / np.maximum(every, 1e-6), np.float32)
