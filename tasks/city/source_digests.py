"""What a city is made of, as digests: by these a run knows that nothing changed upstream, and reads nothing."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from catalogs.block.corrections import corrections_file
from catalogs.block.keys import BlockKeys, check_keys
from catalogs.block.paths import resolve_paths
from catalogs.block.yaml_files import read_yaml
from catalogs.city.keys import check_city
from catalogs.file_digest import file_digest
from tasks.engine.stage_code import code_version
from tasks.stages.order import CODE_STAGES


def city_source_digest(path: Path) -> str:
    """The sha256 of a city file, of what people corrected, and of all files that it names, those beside them with the same stem
    included, as some formats are of several; empty where it names block files, of which each names others.

    Raises ValueError where it cannot be used.
    """
    values = read_yaml(path)
    asked = check_city(values, path)
    return "" if isinstance(asked, str) else _digest(values, asked.block_keys, asked.tile_indexes, path)


def block_source_digest(path: Path) -> str:
    """The same of a block file, with the code that reads it; empty where it cannot be used."""
    try:
        values = read_yaml(path)
        return f"{_digest(values, check_keys(values), (), path)} {block_code_version()}"
    except (ValueError, OSError):
        return ""


def _digest(values: object, keys: BlockKeys, more: tuple[Path, ...], path: Path) -> str:
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
    return [one for one in path.parent.glob(f"{_escape_glob(path.stem)}*") if one.is_file()] or [path]


def _escape_glob(stem: str) -> str:
    return "".join(f"[{sign}]" if sign in "*?[" else sign for sign in stem)


def block_code_version() -> str:
    """The version of the code by which blocks are run."""
    return code_version(CODE_STAGES)
