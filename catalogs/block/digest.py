"""Digests of the values that determine the result of a block.

Parsed values are hashed, not the bytes or names of files: the order of keys does not matter, and a file that a named
file refers to does. Pictures are hashed by their bytes.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields
from typing import TYPE_CHECKING

from catalogs.block.declared_keys import Effect
from catalogs.block.settings import select_settings
from catalogs.block.value_encoding import DigestEncoder
from catalogs.file_digest import file_digest
from catalogs.readers.pictures.folders import picture_and_label_paths
from facade_core.core.types import TrainedModelFiles

if TYPE_CHECKING:
    from catalogs.block.reader import Block


def block_digest(block: Block) -> str:
    """Compute the sha256 of the values of a block, without its own digest and its notes, which name files.

    Names of pictures are hashed where a result shows them: a facade's source, the id of an exemplar or panorama.
    """
    contents = {
        field.name: getattr(block, field.name) for field in fields(block) if field.name not in ("digest", "notes")
    }
    return _value_digest(
        contents
        | {
            "settings": select_settings(block.settings, Effect.PLAN, Effect.UNITS),
            "crs": block.crs.to_string(),
            "exemplars": [(path.stem, *map(file_digest, picture_and_label_paths(path))) for path in block.exemplars],
            "style": [(path.name, file_digest(path)) for path in block.style],
            "photos": [(facade, path.name, file_digest(path)) for facade, path in sorted(block.photos.items())],
            "panoramas": [
                (one.id, one.path.name, one.pose, file_digest(one.path), one.captured) for one in block.panoramas
            ],
            "textures": list(map(file_digest, block.textures)),
            "aerial": _aerial_inputs(block),
            "roof_material": block.roof_material and block.roof_material.digest_content(),
            "materials": [one.digest_content() for one in block.materials],
            "models": model_file_digests(block.models),
            "corrections": block.corrections.digest_inputs(),
        }
    )


def plan_input_digest(block: Block) -> str:
    """Compute the sha256 of the inputs of a block's plan: geometry and settings, without panoramas."""
    return _value_digest(
        {
            "settings": select_settings(block.settings, Effect.PLAN),
            "crs": block.crs.to_string(),
            "buildings": block.buildings,
            "streets": block.streets,
            "ground": block.ground,
            "terrain": block.terrain,
            "neighbours": block.neighbours,
            "aerial": _aerial_inputs(block),
            "own": block.part and (block.part.buildings, block.part.streets),
        }
    )


def model_file_digests(models: TrainedModelFiles) -> list[list[str]]:
    """Return for each model that a block names: its name and the digests of its files."""
    return [[name, *map(file_digest, files)] for name, files in models.digest_content().items()]


def _aerial_inputs(block: Block) -> object:
    return block.aerial and block.aerial.digest_content()


def _value_digest(value: object) -> str:
    return hashlib.sha256(DigestEncoder().encode_bytes(value)).hexdigest()
