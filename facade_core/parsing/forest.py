"""The forest segmenter: votes of two forests on a grid, averaged in superpixels (tiles paper, sections 3.1 and 4.1)."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.core.errors import ModelError
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.core.model_file import open_session, read_record, stamp
from facade_core.parsing import forest_features
from facade_core.parsing.segmentation import Segmented

SHIPPED = Path(__file__).parent / "models" / "forest.onnx"

# Names of the two forests in the file; each has the input NAME_rows and the output NAME_votes.
FIRST, SECOND = "first", "second"

# Constant, so that sums over trees are formed in the same order on every machine.
_INTRA_OP_THREADS = 1
_WIDTHS = {FIRST: forest_features.APPEARANCE_WIDTH, SECOND: forest_features.CONTEXT_WIDTH}
# Some 1000 to 2000 segments in a facade of usual size. Compact ones: loose ones cut corners off windows.
_SEGMENT_AREA = 100
_COMPACTNESS = 20
_SLIC_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class Forests:
    """Both forests in one inference session."""

    session: Any
    # About the size of the facades trained on: parsed at a quarter of their size as they are, the held-out ones keep
    # 68 % of their pixels right; enlarged first, 85 %.
    working_area = (150_000, 250_000)

    def segment(self, image: np.ndarray) -> Segmented:
        """Of an image (H, W, 3) uint8; nothing is thought hidden, and what is sky outside."""
        seen = forest_features.appearance(image)
        first = self.vote(FIRST, seen)
        second = self.vote(SECOND, forest_features.context(first, seen))
        confidence = _average_in_segments(image, _cells_to_pixels(second, *image.shape[:2]))
        return Segmented(confidence, np.zeros(image.shape[:2], np.float32), confidence[..., FacadeClass.SKY])

    def vote(self, name: str, rows: np.ndarray) -> np.ndarray:
        """Votes of one forest, averaged over its trees: (h, w, n) float32 -> (h, w, 7) float32."""
        # The runtime wants every input; the forest whose output is not asked for gets one row of zeros.
        feed = {f"{other}_rows": np.zeros((1, width), np.float32) for other, width in _WIDTHS.items()}
        feed[f"{name}_rows"] = rows.reshape(-1, rows.shape[-1])
        return self.session.run([f"{name}_votes"], feed)[0].reshape(*rows.shape[:2], len(CLASSES))


def load(path: str | Path | None = None) -> Forests:
    """Load the forests from an .onnx file with its .json beside it; the shipped ones without a path.

    Raises ModelError for a missing file, a checksum that differs from the .json's and a model of other features.
    """
    path = SHIPPED if path is None else Path(path)
    return _load(path.resolve(), stamp(path))


@functools.lru_cache(maxsize=2)
def _load(path: Path, _stamp: tuple[tuple[int, int], ...]) -> Forests:
    record = read_record(path)
    if record.get("feature_version") != forest_features.FEATURE_VERSION:
        raise ModelError(f"{path}: made for other classes or features; train it anew with this version")
    session = open_session(path, record, threads=_INTRA_OP_THREADS)
    widths = {node.name: node.shape[1] for node in session.get_inputs()}
    if widths != {f"{name}_rows": width for name, width in _WIDTHS.items()}:
        raise ModelError(f"{path}: takes {widths}, not this version's features; train it anew with this version")
    return Forests(session)


def _cells_to_pixels(votes: np.ndarray, height: int, width: int) -> np.ndarray:
    import cv2

    size = (votes.shape[1] * forest_features.CELL, votes.shape[0] * forest_features.CELL)
    return cv2.resize(votes, size, interpolation=cv2.INTER_LINEAR)[:height, :width]


def _average_in_segments(image: np.ndarray, votes: np.ndarray) -> np.ndarray:
    """Each pixel's own votes and its segment's mean, in equal parts.

    The segment's mean alone, as in the paper, loses 1.5 % of the ECP pixels at this segment size and 6.5 % at 180
    pixels a segment with loose segments: railings that one sees a window through tear the segments.
    """
    from skimage.segmentation import slic

    count = max(1, round(image.shape[0] * image.shape[1] / _SEGMENT_AREA))
    segments = slic(image, n_segments=count, compactness=_COMPACTNESS, max_num_iter=_SLIC_ROUNDS, start_label=0)
    segments = segments.reshape(-1)
    flat = votes.reshape(-1, len(CLASSES))
    sums = np.stack([np.bincount(segments, column) for column in flat.T], axis=1)
    means = sums / sums.sum(1, keepdims=True)
    return ((flat + means[segments]) / 2).reshape(votes.shape).astype(np.float32)
