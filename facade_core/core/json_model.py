"""Files of trained models as JSON: the model with its checksum and the versions that it was made for."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from facade_core.core.errors import ModelFileError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import read_regular


def read_json_model(path: Path, kind: str, made_for: Mapping[str, object], remedy: str) -> JsonObject:
    """Read a model's file: what it was made for, details, and the model itself under "model".

    Parameters
    ----------
    path : file.
    kind : what the model is, for messages, such as "layout model".
    made_for : values that the file must state.
    remedy : what the user can do, for messages.

    Raises
    ------
    ModelFileError
        The file is missing or invalid, its checksum differs, or another version wrote it.
    """
    try:
        record = json.loads(read_regular(path))
    except OSError as error:
        raise ModelFileError(f"{path}: no such {kind}; {remedy}") from error
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"{path}: not valid JSON ({error}); {remedy}") from error
    if not isinstance(record, dict) or not isinstance(record.get("model"), dict):
        raise ModelFileError(f"{path}: not a {kind}; {remedy}")
    if record.get("sha256") != model_digest(record["model"]):
        raise ModelFileError(f"{path}: checksum differs from its content; {remedy}")
    if any(record.get(name) != value for name, value in made_for.items()):
        raise ModelFileError(f"{path}: made for another version of Streetloom; {remedy}")
    return record


def model_digest(model: JsonObject) -> str:
    """Compute the checksum of a model in its file."""
    return hashlib.sha256(json.dumps(model, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
