"""The trained forests: two tree ensembles in one ONNX file, checked against the .json beside it."""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.errors import ModelError
from facade_core.labels import CLASSES
from facade_core.parse import features

SHIPPED = Path(__file__).parent / "models" / "forest.onnx"

# Names of the two forests in the file; each has the input NAME_rows and the output NAME_votes.
FIRST, SECOND = "first", "second"

# Constant, so that sums over trees are formed in the same order on every machine.
_INTRA_OP_THREADS = 1
_WIDTHS = {FIRST: features.APPEARANCE_WIDTH, SECOND: features.CONTEXT_WIDTH}


@dataclass(frozen=True, slots=True)
class Forests:
    """Both forests in one inference session."""

    session: Any

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
    record_path = path.with_suffix(".json")
    for file in (path, record_path):
        if not file.is_file():
            raise ModelError(f"{file}: no such file; a parser model is an .onnx file with its .json beside it")
    changed = tuple((file.stat().st_mtime_ns, file.stat().st_size) for file in (path, record_path))
    return _load(path.resolve(), record_path.resolve(), changed)


@functools.lru_cache(maxsize=2)
def _load(path: Path, record_path: Path, _changed: tuple[tuple[int, int], ...]) -> Forests:
    content = path.read_bytes()
    record = _read_record(record_path)
    if record.get("sha256") != hashlib.sha256(content).hexdigest():
        raise ModelError(f"{path}: checksum differs from {record_path.name}; fetch both files again or train anew")
    if record.get("classes") != list(CLASSES) or record.get("feature_version") != features.FEATURE_VERSION:
        raise ModelError(f"{path}: made for other classes or features; train it anew with this version")
    session = _session(path, content)
    widths = {node.name: node.shape[1] for node in session.get_inputs()}
    if widths != {f"{name}_rows": width for name, width in _WIDTHS.items()}:
        raise ModelError(f"{path}: takes {widths}, not this version's features; train it anew with this version")
    return Forests(session)


def _read_record(path: Path) -> dict[str, Any]:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ModelError(f"{path}: not valid JSON ({error}); fetch it again or train the model anew") from error
    if not isinstance(record, dict):
        raise ModelError(f"{path}: not a JSON object; fetch it again or train the model anew")
    return record


def _session(path: Path, content: bytes) -> Any:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = _INTRA_OP_THREADS
    options.inter_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no public root for its errors
        raise ModelError(f"{path}: not a model that onnxruntime reads; fetch it again or train it anew") from error
