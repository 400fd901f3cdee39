"""Writing of model files and their records."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from facade_core.core.json_model import model_digest
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import CLASSES
from facade_core.core.model_file import read_model_record


def write_json_model(path: Path, model: JsonObject, made_for: Mapping[str, object], **details: object) -> None:
    """Write a model with its checksum; equal models give equal bytes."""
    record = {**made_for, **details, "sha256": model_digest(model), "model": model}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record, separators=(",", ":")) + "\n", encoding="utf-8")


def extend_model_record(path: Path, **more: object) -> None:
    """Add entries to the .json record of an .onnx file."""
    text = json.dumps(read_model_record(path) | more, indent=1) + "\n"
    path.with_suffix(".json").write_text(text, encoding="utf-8")


def write_model(content: bytes, path: Path, record: Mapping[str, object]) -> None:
    """Write an .onnx file and its .json record, with checksum and classes added."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    whole = {"sha256": hashlib.sha256(content).hexdigest(), "classes": list(CLASSES), **record}
    path.with_suffix(".json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
