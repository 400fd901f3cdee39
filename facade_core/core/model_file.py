"""Files of trained parsers: an .onnx file and a .json record of the same name that it is checked against."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.core.errors import ModelFileError
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import CLASSES
from facade_core.core.regular_files import MAX_MODEL_BYTES, read_regular

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

_REMEDY = "train it anew with this version"
_FATAL_ONLY = 4


def file_stamps(path: Path, *, has_record: bool = True) -> tuple[tuple[int, int], ...]:
    """Return modification times and sizes of an .onnx file and its record, by which a changed one is loaded again.

    Raises
    ------
    ModelError
        Where one of the files is missing.
    """
    files = (path, path.with_suffix(".json")) if has_record else (path,)
    for file in files:
        if not file.is_file():
            remedy = "a parser model is an .onnx file with its .json beside it" if has_record else "name the .onnx file"
            raise ModelFileError(f"{file}: no such file; {remedy}")
    return tuple((file.stat().st_mtime_ns, file.stat().st_size) for file in files)


def read_model_record(path: Path) -> JsonObject:
    """Read the .json record of an .onnx file.

    Raises
    ------
    ModelError
        Where the record is no JSON object or lists other classes.
    """
    path = path.with_suffix(".json")
    try:
        record = json.loads(read_regular(path))
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"{path}: not valid JSON; fetch it again or train the model anew") from error
    if not isinstance(record, dict):
        raise ModelFileError(f"{path}: not a JSON object; fetch it again or train the model anew")
    if record.get("classes") != list(CLASSES):
        raise ModelFileError(f"{path}: made for other classes or features; {_REMEDY}")
    return record


def open_inference_session(path: Path, record: Mapping[str, object] | None, *, threads: int) -> InferenceSession:
    """Open an inference session of a model file.

    Parameters
    ----------
    path : the .onnx file.
    record : its .json record, with the checksum; None for a file without one.
    threads : threads per operator.

    Raises
    ------
    ModelError
        Where the checksum differs or onnxruntime rejects the file.
    """
    import onnxruntime

    content = read_regular(path, MAX_MODEL_BYTES)
    if record is not None and record.get("sha256") != hashlib.sha256(content).hexdigest():
        raise ModelFileError(f"{path}: checksum differs from {path.stem}.json; fetch both files again or train anew")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = _FATAL_ONLY  # what fails is raised
    # Spinning threads would take as much processor time from other workers as the network itself.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no public root for its errors
        raise ModelFileError(f"{path}: not a model that onnxruntime reads; fetch, export or train it anew") from error
