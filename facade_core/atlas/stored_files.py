"""Files in a store, such as the picture of a page: bytes as they are published, in one chunk that no codec touches."""

from __future__ import annotations

import hashlib
import re

import numpy as np

from facade_core.atlas.journal import Record
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreGroup, group_at

# Folders of encoded files, made by ingest: units that run side by side must not create the same group.
# hierarchies: the variations of each facade; earlier: how each that changed was at the capture before, a small WebP, grey where
# that shows something in front or nothing; pages: every page of the atlas as JPEG; tiles: models of the cells of a quadtree as
# GLB; coarse: the rasters of a tile's charts made smaller, one after the other; pictures: those of the report, views as JPEG,
# of a facade its WebP files one after the other.
HIERARCHIES, EARLIER, PAGES, TILES, COARSE, PICTURES = "hierarchies", "earlier", "pages", "tiles", "coarse", "pictures"
FOLDERS = (HIERARCHIES, EARLIER, PAGES, TILES, COARSE, PICTURES)
# The stages whose units write them.
FILE_STAGES = ("facades", "pages", "tiles", "pictures")


def hierarchy_path(chart: int) -> str:
    """Where a store has the variations of the facade on the chart of an id."""
    return f"{HIERARCHIES}/{chart:016x}"


def earlier_path(chart: int) -> str:
    """Where a store has how the facade on the chart of an id was before."""
    return f"{EARLIER}/{chart:016x}"


def page_path(page: int) -> str:
    """Where a store has the picture of a page."""
    return f"{PAGES}/{page}"


def tile_paths(name: str) -> tuple[str, str]:
    """Where a store has the model of a tile, and its coarse rasters."""
    return f"{TILES}/{name}", f"{COARSE}/{name}"


def picture_path(name: str) -> str:
    """Where a store has a picture, or those of a facade."""
    return f"{PICTURES}/{name}"


def unit_files(stage: str, unit: int, record: Record | None) -> dict[str, str]:
    """The files that a unit of a stage wrote, path -> digest; none where it is not done."""
    if record is None or record["status"] != "done":
        return {}
    if stage == "facades":
        variations = {record["variation_file"]: record["variation_digest"]} if "variation_file" in record else {}
        return variations | ({record["before_file"]: record["before_digest"]} if "before_file" in record else {})
    if stage == "pages":
        return {page_path(unit): record["digest"]}
    if stage == "tiles":
        return dict(zip(tile_paths(record["unit"]), (record["digest"], record["coarse"]), strict=True))
    return {picture_path(record["file"]): record["digest"]} if "file" in record else {}


def write_stored_file(group: StoreGroup, path: str, data: bytes, long_name: str) -> None:
    """Put a file in the store, in place of what was there."""
    group.create_array(
        path,
        data=np.frombuffer(data, np.uint8),
        chunks=(max(1, len(data)),),
        compressors=None,
        # of this file alone: xarray opens a folder as one dataset, and files differ in length
        dimension_names=(re.sub(r"\W", "_", f"byte_of_{path}"),),
        attributes={"long_name": long_name},
        overwrite=True,
    )


def read_stored_file(group: StoreGroup, path: str, digest: str) -> bytes:
    """A file of the store. Raises StoreError where there is none, or it has another digest."""
    return read_verified_array(group, path, digest).tobytes()


def read_verified_array(group: StoreGroup, path: str, digest: str) -> np.ndarray:
    """A file, or coarse rasters, as the array that the store has of it. Raises StoreError as `read_encoded` does."""
    if path not in group:
        raise StoreError(f"{path} is not in the store; the next run makes it again")
    data = np.asarray(group[path][:])
    if stored_file_digest(np.ascontiguousarray(data).data) != digest:
        raise StoreError(f"{path} is not as it was written; the next run makes it again")
    return data


def stored_file_digest(data: bytes | memoryview) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def delete_stored_files(group: StoreGroup, folder: str, kept: set[str]) -> None:
    """Remove the files of a folder but for those of some names."""
    for name, _ in list(group_at(group, folder).arrays()):
        if name not in kept:
            del group[f"{folder}/{name}"]
