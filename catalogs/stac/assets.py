"""STAC assets of a published block: media type, roles, size and checksum of its files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.features import safe_file_stem

if TYPE_CHECKING:
    from pystac import Asset

_MEDIA_TYPES = {".webp": "image/webp", ".jpg": "image/jpeg", ".png": "image/png"}
# Files of a block: path in its folder, key, title, media type, roles.
_BLOCK_FILES = (
    ("items.parquet", "items", "one row per facade and per unit set aside", "application/vnd.apache.parquet", ["data"]),
    ("block.glb", "model", "textured model of the block", "model/gltf-binary", ["data", "visual"]),
    (
        "surroundings.glb",
        "surroundings",
        "what stands around: trees, lamps, other objects and neighbours",
        "model/gltf-binary",
        ["visual"],
    ),
    ("overview.glb", "overview", "small model of the block", "model/gltf-binary", ["overview", "visual"]),
    ("tiles/index.json", "tiles", "list of the block's tiles", "application/json", ["data"]),
    ("report/index.html", "report", "report", "text/html", ["overview"]),
)
_IMAGES_FOLDER = "report/images"


def block_assets(folder: Path, up: str) -> dict[str, Asset]:
    """Return assets of the table, models, list of tiles and report that exist in a folder.

    Parameters
    ----------
    up : relative path from the STAC file to `folder`.
    """
    return {
        key: _file_asset(folder, path, up, title=title, media_type=media_type, roles=roles)
        for path, key, title, media_type, roles in _BLOCK_FILES
        if (folder / path).is_file()
    }


def tile_assets(folder: Path, up: str) -> dict[str, Asset]:
    """Return assets of the tiles that the list in `folder` names; none without a list."""
    listed = folder / "tiles" / "index.json"
    if not listed.is_file():
        return {}
    return {
        f"tile-{tile['path']}": _make_asset(
            f"{up}tiles/{tile['file']}",
            tile["bytes"],
            tile["sha256"],
            title=f"tile {tile['path']}",
            media_type="model/gltf-binary",
            roles=["data", "visual"],
        )
        for tile in json.loads(listed.read_text(encoding="utf-8"))["tiles"]
    }


def icechunk_store_asset(up: str, fields: Mapping[str, object] | None = None) -> Asset:
    """Return the asset of the run's Icechunk store, two folders above the block."""
    from pystac import Asset

    title, media_type = "Icechunk store: atlas, panoramas and journal", "application/vnd.zarr; version=3"
    return Asset(f"{up}../../store", title, media_type=media_type, roles=["data"], extra_fields=dict(fields or {}))


def report_picture_assets(folder: Path, pictures: Iterable[tuple[str, str]], up: str) -> dict[str, Asset]:
    """Return assets of the report's pictures (key, file name); the one of the whole is the thumbnail."""
    assets = {}
    for key, name in pictures:
        roles = ["thumbnail", "overview"] if key in ("result", "above") else ["overview"]
        media_type = _MEDIA_TYPES[Path(name).suffix]
        assets[key] = _file_asset(folder, f"{_IMAGES_FOLDER}/{name}", up, title=key, media_type=media_type, roles=roles)
    return assets


def pictures_by_unit(folder: Path, units: Iterable[str]) -> dict[str | None, list[tuple[str, str]]]:
    """Group the report's pictures (key, file name) by unit; the block's are under None.

    A picture is named after its unit and a stage, `w1-f2-level-0.webp`; the longest matching unit is taken.
    """
    stems = {safe_file_stem(unit): unit for unit in units}
    found: dict[str | None, list[tuple[str, str]]] = {}
    for path in sorted((folder / _IMAGES_FOLDER).glob("*")):
        if path.suffix not in _MEDIA_TYPES:
            continue
        parts = path.stem.split("-")
        for cut in range(len(parts) - 1, 0, -1):
            if (unit := stems.get("-".join(parts[:cut]))) is not None:
                found.setdefault(unit, []).append(("-".join(parts[cut:]), path.name))
                break
        else:
            found.setdefault(None, []).append((path.stem, path.name))
    return found


def model_card_asset(folder: Path, name: str) -> Asset:
    """Return the asset of a model's card, in the folder of its Item."""
    return _file_asset(folder, name, "./", title="model card", media_type="text/markdown", roles=["metadata"])


def stac_geoparquet_asset(folder: Path, name: str) -> Asset:
    """Return the asset of a Collection's stac-geoparquet file, which holds all its Items."""
    media_type = "application/vnd.apache.parquet"
    return _file_asset(folder, name, "./", title="all Items", media_type=media_type, roles=["collection-mirror"])


def _file_asset(folder: Path, path: str, up: str, *, title: str, media_type: str, roles: list[str]) -> Asset:
    with (folder / path).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
        size = file.tell()
    return _make_asset(up + path, size, digest.hexdigest(), title=title, media_type=media_type, roles=roles)


def _make_asset(href: str, size: int, sha256: str, *, title: str, media_type: str, roles: list[str]) -> Asset:
    from pystac import Asset

    # a multihash: the code of sha2-256, the length in bytes, the digest
    fields = {"file:size": size, "file:checksum": f"1220{sha256}"}
    return Asset(href, title, media_type=media_type, roles=roles, extra_fields=fields)
