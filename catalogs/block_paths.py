"""The paths that a block file names: where they lie, and one line for each that is not there."""

from __future__ import annotations

import difflib
import os
import re
from pathlib import Path

from catalogs.block_keys import BlockKeys

# Keys that name a folder of pictures; the others name a file.
FOLDERS = ("imagery.exemplars.path", "imagery.photos.path", "imagery.panoramas.path")


def named_paths(keys: BlockKeys, block: Path) -> dict[str, tuple[Path, ...]]:
    """Dotted key -> the paths it names, relative to the block file, all of which exist.

    `${NAME}` in a path stands for an environment variable. Raises ValueError, "key: problem; remedy".
    """
    buildings = [keys.buildings.path] if isinstance(keys.buildings.path, str) else keys.buildings.path
    named = {"buildings.path": buildings}
    imagery = keys.imagery
    for key, holder in (
        ("streets.path", keys.streets),
        ("terrain.path", keys.terrain),
        ("imagery.exemplars.path", imagery.exemplars),
        ("imagery.photos.path", imagery.photos),
        ("imagery.panoramas.path", imagery.panoramas),
        ("imagery.aerial.path", imagery.aerial),
        ("texture.roof_material.path", keys.texture.roof_material),
    ):
        if holder:
            named[key] = [holder.path]
    if imagery.panoramas and imagery.panoramas.poses:
        named["imagery.panoramas.poses"] = [imagery.panoramas.poses]
    return {key: tuple(_existing(key, text, block) for text in texts) for key, texts in named.items()}


def _existing(key: str, text: str, block: Path) -> Path:
    path = block.parent / Path(_expanded(key, text)).expanduser()
    if not path.exists():
        near = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        close = difflib.get_close_matches(path.name, near, n=1)
        remedy = f"did you mean {close[0]}?" if close else "paths are relative to the block file"
        raise ValueError(f"{key}: {path} does not exist; {remedy}")
    if key not in FOLDERS and not path.is_file():
        raise ValueError(f"{key}: {path} is a folder; name a file in it")
    return path


def _expanded(key: str, text: str) -> str:
    def value(match: re.Match[str]) -> str:
        found = os.environ.get(match[1])
        if not found:
            raise ValueError(
                f"{key}: the environment variable {match[1]} is not set; set it to the folder that is meant"
            )
        return str(Path(found).expanduser().absolute())

    return re.sub(r"\$\{(\w+)\}", value, text)
