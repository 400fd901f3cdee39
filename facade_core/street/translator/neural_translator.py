"""Neural translator: the trained network in onnxruntime (street paper, 3 Neural network)."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.model_file import open_inference_session
from facade_core.geometry.raycast import MISS
from facade_core.street.propagation.render import RenderedPanorama
from facade_core.street.translator.equirectangular_taps import gather_taps

if TYPE_CHECKING:
    from onnxruntime import InferenceSession


SHIPPED_TRANSLATOR = Path(__file__).parent / "models" / "translator.onnx"
# Increase it when the meaning of inputs or outputs changes.
TRANSLATOR_VERSION = 1
# Constant, so that results do not depend on the machine's number of cores.
_INTRA_OP_THREADS = 2
# Receptive field of an output, pixels; a multiple of the network's stride of 4.
RECEPTIVE_MARGIN = 96
# Pixels per call of the network, margin included; it needs about 2 kB of memory per pixel.
MAX_NETWORK_PIXELS = 600_000


@dataclass(frozen=True)
class NeuralTranslator:
    """Trained network that continues from the texture of a partially textured panorama.

    Attributes
    ----------
    session : onnxruntime session.
    """

    session: InferenceSession

    def translate(self, panorama: RenderedPanorama) -> UInt8Array:
        """Return the fully textured panorama, (h, w, 3) uint8, sky black. Widths are multiples of 8."""
        rgb = self.translate_image(panorama.rgb)
        rgb[panorama.chart == MISS] = panorama.rgb[panorama.chart == MISS]
        return rgb

    def translate_image(self, image: UInt8Array) -> UInt8Array:
        """Translate a whole panorama (h, 2 h, 3) uint8 in tiles that equal the whole.

        Raises
        ------
        ModelError
            The width is not a multiple of 8.
        """
        height, width = image.shape[:2]
        if width % 8:
            raise ModelFileError(
                f"a panorama {width} pixels wide; the network takes multiples of 8: change panorama_width"
            )
        planes = np.ascontiguousarray(image.transpose(2, 0, 1), np.float32) / np.float32(127.5) - 1
        out = np.empty((height, width, 3), np.uint8)
        for top, bottom, left, right in _tiles(height, width):
            first, last = max(top - RECEPTIVE_MARGIN, 0), min(bottom + RECEPTIVE_MARGIN, height)
            reach = RECEPTIVE_MARGIN if right - left < width else 0
            seen = gather_taps(planes, (first, last), (left - reach, right + reach))
            rgb = self.session.run(None, {"seen": seen[None]})[0][0]
            tile = rgb[:, top - first : bottom - first, reach : reach + right - left].transpose(1, 2, 0)
            out[top:bottom, left:right] = np.clip((tile + 1) * 127.5 + 0.5, 0, 255)
        return out


def _tiles(height: int, width: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield tiles (top, bottom, left, right) of a panorama; one tile if it is small."""
    side = math.isqrt(MAX_NETWORK_PIXELS) - 2 * RECEPTIVE_MARGIN
    down, across = (height, width) if height * width <= MAX_NETWORK_PIXELS else (side // 4 * 4, side // 4 * 4)
    for top in range(0, height, down):
        for left in range(0, width, across):
            yield top, min(top + down, height), left, min(left + across, width)


def load_translator(path: Path = SHIPPED_TRANSLATOR) -> NeuralTranslator:
    """Load the translator of an .onnx file with its .json record.

    Raises
    ------
    ModelError
        A file is missing, the checksum differs, or the network has another version.
    """
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise ModelFileError(f"{file}: no such file; a translator is an .onnx file with its .json beside it")
    return _load_cached(path.resolve(), path.stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _load_cached(path: Path, _modified: int) -> NeuralTranslator:
    try:
        record = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        version = record["version"]
    except (ValueError, KeyError, TypeError) as error:
        raise ModelFileError(
            f"{path.with_suffix('.json')}: not the record of a translator; fetch both files again"
        ) from error
    if version != TRANSLATOR_VERSION:
        raise ModelFileError(f"{path}: made for another version of the translator; train it anew with this version")
    return NeuralTranslator(open_inference_session(path, record, threads=_INTRA_OP_THREADS))


def write_translator(content: bytes, path: Path, record: Mapping[str, object]) -> None:
    """Write an .onnx file and its .json record with the checksum."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    whole = {"sha256": hashlib.sha256(content).hexdigest(), **record}
    path.with_suffix(".json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
