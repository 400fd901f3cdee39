"""Files of trained parsers: an .onnx, and beside it a .json that it is checked against."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from facade_core.core.errors import ModelError
from facade_core.core.labels import CLASSES

_REMEDY = "train it anew with this version"


def stamp(path: Path) -> tuple[tuple[int, int], ...]:
    """Changes when one of the two files does. Raises ModelError where one is missing."""
    files = (path, path.with_suffix(".json"))
    for file in files:
        if not file.is_file():
            raise ModelError(f"{file}: no such file; a parser model is an .onnx file with its .json beside it")
    return tuple((file.stat().st_mtime_ns, file.stat().st_size) for file in files)


def read_record(path: Path) -> dict[str, Any]:
    """The .json beside an .onnx file. Raises ModelError where it is no JSON object or for other classes."""
    path = path.with_suffix(".json")
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ModelError(f"{path}: not valid JSON ({error}); fetch it again or train the model anew") from error
    if not isinstance(record, dict):
        raise ModelError(f"{path}: not a JSON object; fetch it again or train the model anew")
    if record.get("classes") != list(CLASSES):
        raise ModelError(f"{path}: made for other classes or features; {_REMEDY}")
    return record


def open_session(path: Path, record: Mapping[str, Any], *, threads: int) -> Any:
    """The inference session of a file whose checksum is the record's. Raises ModelError otherwise."""
    import onnxruntime

    content = path.read_bytes()
    if record.get("sha256") != hashlib.sha256(content).hexdigest():
        raise ModelError(f"{path}: checksum differs from {path.stem}.json; fetch both files again or train anew")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads that wait take a processor from the other workers otherwise: as much again as the network itself.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no public root for its errors
        raise ModelError(f"{path}: not a model that onnxruntime reads; fetch it again or train it anew") from error


def add_to_record(path: Path, **more: Any) -> None:
    """Add to the .json beside an .onnx file."""
    text = json.dumps(read_record(path) | more, indent=1) + "\n"
    path.with_suffix(".json").write_text(text, encoding="utf-8")


def write_model(content: bytes, path: Path, record: Mapping[str, Any]) -> None:
    """Write an .onnx file and the .json beside it, checksum and classes added to the record."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    whole = {"sha256": hashlib.sha256(content).hexdigest(), "classes": list(CLASSES), **record}
    path.with_suffix(".json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
