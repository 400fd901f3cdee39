"""One digest of everything that determines a block's result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.block_keys import BlockKeys
from catalogs.buildings import Buildings

if TYPE_CHECKING:
    from pyproj import CRS

    from catalogs.readers.panoramas import PosedPanorama


def block_digest(
    keys: BlockKeys,
    crs: CRS,
    files: Mapping[str, tuple[Path, ...]],
    built: Buildings,
    exemplars: Iterable[Path],
    photos: Mapping[str, Path],
    panoramas: Iterable[PosedPanorama],
) -> str:
    """The sha256 of settings and contents of files: not of their places or dates."""
    settings = {
        "name": keys.name,
        "crs": crs.to_string(),
        "area": keys.area,
        "buildings": keys.buildings.model_dump(exclude={"path"}),
        "streets": keys.streets and [keys.streets.crs, sorted(keys.streets.names or [])],
        "texture": asdict(keys.texture),
        "storey": keys.storey,
        "geoid_separation": keys.geoid_separation,
        "seed": keys.seed,
        "geometry": [
            [key, *map(_file_digest, files.get(key, ()))] for key in ("buildings.path", "streets.path", "terrain.path")
        ],
        "rectified": keys.imagery.photos is None or keys.imagery.photos.rectified,
        "images": [
            [(path.name, _file_digest(path)) for path in folder]
            for folder in (exemplars, photos.values(), built.textures)
        ],
        "panoramas": [(p.id, asdict(p.pose), _file_digest(p.path)) for p in panoramas],
    }
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
