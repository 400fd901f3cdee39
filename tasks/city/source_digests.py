"""Digests of the inputs of a city, by which a run detects unchanged inputs without reading them."""

from __future__ import annotations

import glob
import hashlib
import json
from pathlib import Path

from catalogs.block.corrections import corrections_file
from catalogs.block.key_faults import validate_block_settings
from catalogs.block.keys import BlockFileSettings
from catalogs.block.paths import resolve_paths
from catalogs.block.yaml_files import read_yaml
from catalogs.city.keys import validate_city_settings
from catalogs.file_digest import file_digest
from tasks.engine.stage_code import code_version
from tasks.stages.order import CODE_STAGES


def city_source_digest(path: Path) -> str:
    """Compute the sha256 of a city file, of its corrections and of all files that it names.

    Files with the same stem are included, because some formats consist of several files. The digest is empty for a
    city of block files, each of which names files of its own.

    Raises
    ------
    ValueError : the city file cannot be used.
    """
    values = read_yaml(path)
    asked = validate_city_settings(values, path)
    return "" if isinstance(asked, str) else _digest(values, asked.block_keys, asked.tile_indexes, path)


def block_source_digest(path: Path) -> str:
    """Compute the digest of a block file's inputs and of the code that reads them; empty if unusable."""
    try:
        values = read_yaml(path)
        return f"{_digest(values, validate_block_settings(values), (), path)} {block_code_version()}"
    except (ValueError, OSError):
        return ""


def _digest(values: object, keys: BlockFileSettings, more: tuple[Path, ...], path: Path) -> str:
    said = corrections_file(path)
    named = [
        *([said] if said.is_file() else []),
        *more,
        *(one for paths in resolve_paths(keys, path).values() for one in paths),
    ]
    files = sorted({file for one in named for file in _find_files(one)})
    digest = hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode())
    for file in files:
        digest.update(f"{file.name} {file_digest(file)}\n".encode())
    return digest.hexdigest()


def _find_files(path: Path) -> list[Path]:
    if path.is_dir():
        return [one for one in path.rglob("*") if one.is_file()]
    return [one for one in path.parent.glob(f"{glob.escape(path.stem)}*") if one.is_file()] or [path]


def block_code_version() -> str:
    """Return the version of the code that runs blocks."""
    return code_version(CODE_STAGES)
