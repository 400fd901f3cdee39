"""File of the shipped grain examples: arrays only, checked against the record next to it."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from facade_core.core.errors import ModelFileError
from facade_core.street.materials.grain import (
    DEFAULT_EXAMPLES,
    EXAMPLE_NAMES,
    TILE_PIXELS,
    GrainExample,
    GrainTables,
    WeightedGrain,
    build_grain_tables,
)

SHIPPED_EXAMPLES = Path(__file__).parent / "models" / "materials.npz"
EXAMPLE_FORMAT = 1
_REMEDY = "fetch both files again or run `streetloom train materials`"


def load_examples(path: Path = SHIPPED_EXAMPLES) -> dict[str, GrainExample]:
    """Read the examples of a file by name.

    Raises
    ------
    ModelError
        A file is missing or invalid, or differs from its record.
    """
    record_path = path.with_suffix(".json")
    try:
        content, record = path.read_bytes(), json.loads(record_path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ModelFileError(f"{error.filename}: cannot be read ({error.strerror}); {_REMEDY}") from error
    except ValueError as error:
        raise ModelFileError(f"{record_path}: not valid JSON ({error}); {_REMEDY}") from error
    if (
        not isinstance(record, dict)
        or record.get("format") != EXAMPLE_FORMAT
        or record.get("names") != list(EXAMPLE_NAMES)
    ):
        raise ModelFileError(f"{record_path}: of another version; {_REMEDY}")
    if record.get("sha256") != hashlib.sha256(content).hexdigest():
        raise ModelFileError(f"{path}: checksum differs from {record_path.name}; {_REMEDY}")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {field: file[field] for field in GrainExample._fields}
    except (ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ModelFileError(f"{path}: holds no examples ({error}); {_REMEDY}") from error
    if arrays["tile"].shape != (len(EXAMPLE_NAMES), TILE_PIXELS, TILE_PIXELS):
        raise ModelFileError(f"{path}: of another version; {_REMEDY}")
    return {
        name: GrainExample(*(arrays[field][k] for field in GrainExample._fields))
        for k, name in enumerate(EXAMPLE_NAMES)
    }


@lru_cache(maxsize=1)
def load_shipped_grain_tables() -> GrainTables:
    """Return the kernel tables of the shipped examples."""
    return load_grain_tables({})


def load_grain_tables(block_examples: Mapping[str, GrainExample]) -> GrainTables:
    """Return the kernel tables with a block's own examples, by name, in place of shipped ones."""
    examples = load_examples()
    defaults = {name: WeightedGrain(examples[example], weight) for name, (example, weight) in DEFAULT_EXAMPLES.items()}
    return build_grain_tables(
        [
            WeightedGrain(block_examples[name], uses_colour=True) if name in block_examples else grain
            for name, grain in defaults.items()
        ]
    )
