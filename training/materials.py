"""Generation of the shipped material examples from photographs."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.regular_files import MAX_MODEL_BYTES, read_regular
from facade_core.street.materials.grain import EXAMPLE_NAMES, GrainExample, learn_grain
from facade_core.street.materials.grain_file import EXAMPLE_FORMAT
from training.progress import track_progress

# Picture in materials/, its width in metres, and the size of structure that is not grain, metres.
GRAIN_PHOTOS: dict[str, tuple[str, float, float | None]] = {
    "asphalt": ("asphalt.jpg", 1.2, None),
    "gravel": ("gravel.jpg", 0.6, None),
    "grass": ("grass.jpg", 1.5, None),
    "earth": ("earth-grass.jpg", 1.0, None),
    "concrete": ("concrete.jpg", 1.2, None),
    "plaster-fine": ("plaster-fine.jpg", 2.5, None),
    "plaster-rough": ("plaster-rough.jpg", 1.0, None),
    "metal": ("metal-sheet.jpg", 1.0, None),
    "boards": ("boards.jpg", 1.0, 0.03),
}


def learn_grain_examples(data: Path, out: Path) -> Path:
    """Learn grain examples from the CC0 pictures in `data`/materials, and write materials.npz into `out`."""
    examples: dict[str, GrainExample] = {}
    sources = {}
    for name in track_progress("examples", EXAMPLE_NAMES, len(EXAMPLE_NAMES)):
        file, width, structure = GRAIN_PHOTOS[name]
        image, digest = read_picture_and_digest(data / "materials" / file)
        examples[name] = learn_grain(image, width, structure=structure)
        sources[name] = {"picture": file, "sha256": digest, "metres": width, "licence": "CC0-1.0"}
    path = out / "materials.npz"
    save_examples(examples, path, sources=sources)
    return path


def read_picture_and_digest(path: Path) -> tuple[UInt8Array, str]:
    """Decode a picture (h, w, 3) uint8, and compute the sha256 of its file."""
    import cv2

    try:
        content = read_regular(path, MAX_MODEL_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give --data a folder with materials/") from error
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: no picture; fetch it again")
    return np.asarray(image[..., ::-1], np.uint8), hashlib.sha256(content).hexdigest()


def save_examples(examples: Mapping[str, GrainExample], path: Path, **details: object) -> None:
    """Write the examples of all `EXAMPLE_NAMES` and a record with checksum and details."""
    ordered = [examples[name] for name in EXAMPLE_NAMES]
    arrays = {field: np.array([getattr(example, field) for example in ordered]) for field in GrainExample._fields}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(buffer.getvalue())
    record = {
        "format": EXAMPLE_FORMAT,
        "sha256": hashlib.sha256(buffer.getvalue()).hexdigest(),
        "names": list(EXAMPLE_NAMES),
        **details,
    }
    path.with_suffix(".json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
