"""Network segmenter: an encoder-decoder in onnxruntime, averaged over mirrored and scaled views."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from facade_core.core.arrays import Float32Array, Float64Array, UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.core.model_file import file_stamps, open_inference_session, read_model_record
from facade_core.parsing.segmentation import Segmentation

if TYPE_CHECKING:
    from onnxruntime import InferenceSession


SHIPPED_NETWORK = Path(__file__).parent / "models" / "network.onnx"

# Raised whenever the meaning of the inputs or outputs changes.
NETWORK_VERSION = 2

# Logits after those of the classes: an occluder is in front of the facade,
OCCLUDER_OUTPUT = len(CLASSES)
# and the pixel is sky, street or a neighbour outside the facade.
OUTSIDE_OUTPUT = len(CLASSES) + 1

# Image sides are multiples of this stride,
COARSEST_STRIDE = 32
# and positions are given at this one.
PLACE_STRIDE = 8

# Constant, so that results do not depend on the number of cores.
_INTRA_OP_THREADS = 2
# Averaged views: share of the working size, and True if mirrored.
AVERAGED_VIEWS = tuple((scale, mirrored) for scale in (0.85, 1.2) for mirrored in (False, True))
# Weight of doors in training: they are one pixel in seventy, and every network's worst class. Inference removes
# this weight again, or doors would be predicted too often.
DOOR_WEIGHT = 3.0
_LOG_CLASS_WEIGHTS = np.array(
    [math.log(DOOR_WEIGHT) if number == FacadeClass.DOOR else 0.0 for number in range(len(CLASSES))], np.float32
)
# Position of the corners of a whole image.
_WHOLE_IMAGE = np.array([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True)
class Network:
    """Network in an inference session, and the image views that it averages."""

    session: InferenceSession
    views: tuple[tuple[float, bool], ...] = AVERAGED_VIEWS
    working_area = (150_000, 250_000)

    def segment(self, image: UInt8Array) -> Segmentation:
        """Segment an image (H, W, 3) uint8 by means over mirrored and scaled views."""
        height, width = image.shape[:2]
        classes = np.zeros((len(CLASSES), height, width), np.float32)
        occluder, outside = np.zeros((2, height, width), np.float32)
        for scale, mirrored in self.views:
            logits = self._view(image, scale, mirrored)
            classes += _softmax(logits[: len(CLASSES)] - _LOG_CLASS_WEIGHTS[:, None, None])
            occluder += special.expit(logits[OCCLUDER_OUTPUT])
            outside += special.expit(logits[OUTSIDE_OUTPUT])
        views = len(self.views)
        confidence = _channels_last(classes / classes.sum(0))
        return Segmentation(
            confidence, np.asarray(occluder / views, np.float32), np.asarray(outside / views, np.float32)
        )

    def _view(self, image: UInt8Array, scale: float, mirrored: bool) -> Float32Array:
        """Return the logits of one view at the image's size, (classes + 2, H, W) float32.

        Planes are faster than pixel-wise channels.
        """
        import cv2

        height, width = image.shape[:2]
        size = tuple(COARSEST_STRIDE * max(1, round(side * scale / COARSEST_STRIDE)) for side in (width, height))
        mode = cv2.INTER_AREA if size[0] * size[1] < width * height else cv2.INTER_LINEAR
        view = cv2.resize(image[:, ::-1].copy() if mirrored else image, size, interpolation=mode)
        feed = {
            "image": np.ascontiguousarray(view.transpose(2, 0, 1)[None], np.float32),
            "place": cell_position_planes(size[1], size[0], _WHOLE_IMAGE)[None],
        }
        logits = self.session.run(None, feed)[0][0].transpose(1, 2, 0)
        if mirrored:
            logits = logits[:, ::-1]
        full = cv2.resize(np.ascontiguousarray(logits), (width, height), interpolation=cv2.INTER_LINEAR)
        return np.ascontiguousarray(np.moveaxis(full, 2, 0))


def _softmax(logits: Float32Array) -> Float32Array:
    """Softmax of planes (classes, H, W) over the classes."""
    shares = np.exp(logits - logits.max(0))
    probabilities: Float32Array = shares / shares.sum(0)
    return probabilities


def _channels_last(planes: Float32Array) -> Float32Array:
    return np.ascontiguousarray(np.moveaxis(planes, 0, 2))


def cell_position_planes(height: int, width: int, corners: Float64Array) -> Float32Array:
    """Compute the positions of an image's cells as two network input planes, across and down.

    Parameters
    ----------
    height, width : size of the image in pixels.
    corners : left, top, right and bottom of the image in positions -1 to 1.

    Returns
    -------
    (2, H / 8, W / 8) float32.
    """
    left, top, right, bottom = corners
    across = left + (np.arange(width // PLACE_STRIDE) + 0.5) * PLACE_STRIDE * (right - left) / width
    down = top + (np.arange(height // PLACE_STRIDE) + 0.5) * PLACE_STRIDE * (bottom - top) / height
    return np.stack(np.broadcast_arrays(across[None, :], down[:, None])).astype(np.float32)


def load_network(path: str | Path) -> Network:
    """Load a network from an .onnx file with a .json of the same name.

    Raises
    ------
    ModelError
        If the file is missing, its checksum differs from the .json's, or its version is another.
    """
    return _cached_network(Path(path).resolve(), file_stamps(Path(path)))


@functools.lru_cache(maxsize=2)
def _cached_network(path: Path, _stamp: tuple[tuple[int, int], ...]) -> Network:
    record = read_model_record(path)
    if record.get("network_version") != NETWORK_VERSION:
        raise ModelFileError(f"{path}: made for another version of the network; train it anew with this version")
    session = open_inference_session(path, record, threads=_INTRA_OP_THREADS)
    names = [node.name for node in (*session.get_inputs(), *session.get_outputs())]
    if names != ["image", "place", "logits"]:
        raise ModelFileError(f"{path}: has {names}, not this version's inputs and outputs; train it anew")
    return Network(session)
