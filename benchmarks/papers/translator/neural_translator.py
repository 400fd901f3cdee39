"""Neural translator: the trained network in onnxruntime (street paper, 3 Neural network)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.papers.translator.colour_grid import NETWORK_HEIGHT, TRAINED_ROWS, apply_colour_grid
from benchmarks.papers.translator.equirectangular_taps import gather_taps
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.model_file import open_inference_session
from facade_core.street.lighting.sky import add_sky
from facade_core.street.propagation.render import RenderedPanorama
from benchmarks.papers.translator.translators import MaterialFieldTranslator

if TYPE_CHECKING:
    from onnxruntime import InferenceSession


PRETRAINED_NETWORK = Path(__file__).parent / "models" / "translator.onnx"
# Increase it when the meaning of inputs or outputs changes.
TRANSLATOR_VERSION = 2
# Constant, so that results do not depend on the machine's number of cores.
_INTRA_OP_THREADS = 2


@dataclass(frozen=True)
class ColourNetwork:
    """Trained network that predicts the colour transforms of a painted panorama.

    Attributes
    ----------
    session : onnxruntime session.
    """

    session: InferenceSession

    def translate_image(self, image: UInt8Array, known: BoolArray) -> UInt8Array:
        """Translate the colours of a whole panorama.

        Parameters
        ----------
        image : (h, 2 h, 3) uint8, painted everywhere.
        known : (h, 2 h) bool, pixels whose colours are given by photos or by earlier viewpoints.

        Returns
        -------
        (h, 2 h, 3) uint8.
        """
        import cv2

        size = (2 * NETWORK_HEIGHT, NETWORK_HEIGHT)
        reduced = cv2.resize(
            np.dstack([image, np.where(known, np.uint8(255), np.uint8(0))]), size, interpolation=cv2.INTER_AREA
        )
        planes = np.ascontiguousarray(reduced.transpose(2, 0, 1), np.float32) / np.float32(127.5) - 1
        seen = gather_taps(planes, (0, NETWORK_HEIGHT))
        grid = self.session.run(None, {"seen": seen[None]})[0][0]
        # training never shows the ground right below: it takes the transforms above it
        lowest = round(TRAINED_ROWS[1] * grid.shape[2])
        grid[:, :, lowest:] = grid[:, :, lowest - 1 : lowest]
        return apply_colour_grid(grid, image)


@dataclass(frozen=True)
class NeuralTranslator:
    """Translator that paints untextured pixels from the material field and translates the colours of the picture.

    Attributes
    ----------
    network : trained network.
    painter : painter of untextured pixels.
    """

    network: ColourNetwork
    painter: MaterialFieldTranslator

    def translate(self, panorama: RenderedPanorama) -> UInt8Array:
        """Return the fully textured panorama, (h, w, 3) uint8, with the sky."""
        painted = add_sky(self.painter.translate(panorama), panorama.depth)
        known = panorama.textured | np.isinf(panorama.depth)
        # known pixels stay as they are: changed again by every viewpoint they would drift
        return np.where(known[..., None], painted, self.network.translate_image(painted, known))


def load_colour_network(path: Path = PRETRAINED_NETWORK) -> ColourNetwork:
    """Load the network of an .onnx file with its .json record.

    Raises
    ------
    ModelError
        A file is missing, the checksum differs, or the network has another version.
    """
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise ModelFileError(f"{file}: no such file; a translator is an .onnx file with its .json beside it")
    return _load_cached(path.resolve(), tuple(file.stat().st_mtime_ns for file in (path, path.with_suffix(".json"))))


@lru_cache(maxsize=2)
def _load_cached(path: Path, _modified: tuple[int, ...]) -> ColourNetwork:
    try:
        record = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        version = record["version"]
    except (ValueError, KeyError, TypeError) as error:
        raise ModelFileError(
            f"{path.with_suffix('.json')}: not the record of a translator; fetch both files again"
        ) from error
    if version != TRANSLATOR_VERSION:
        raise ModelFileError(f"{path}: made for another version of the translator; train it anew with this version")
    return ColourNetwork(open_inference_session(path, record, threads=_INTRA_OP_THREADS))


def write_translator(content: bytes, path: Path, record: Mapping[str, object]) -> None:
    """Write an .onnx file and its .json record with the checksum."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    whole = {"sha256": hashlib.sha256(content).hexdigest(), **record}
    path.with_suffix(".json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
