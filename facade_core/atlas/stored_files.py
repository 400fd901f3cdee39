"""Encoded files in a store: published bytes, each in one uncompressed chunk."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreGroup, get_subgroup

# Folders of encoded files, created by ingest: parallel units must not create the same group.
# Variations of each facade.
HIERARCHIES = "hierarchies"
# Earlier capture of each changed facade, a small WebP; grey where it shows an occluder or nothing.
EARLIER = "earlier"
# Pages of the atlas as JPEG.
PAGES = "pages"
# Models of the cells of a quadtree as GLB.
TILES = "tiles"
# Downsampled rasters of a tile's charts, concatenated.
COARSE = "coarse"
# Pictures of the report: views as JPEG, and each facade's WebP files concatenated.
PICTURES = "pictures"
# Prepared exemplars: a folder of arrays each.
EXEMPLARS = "exemplars"
# What the viewpoints of streets decided: a folder of arrays for each street.
STREET_VIEWS = "street_views"
FOLDERS = (HIERARCHIES, EARLIER, PAGES, TILES, COARSE, PICTURES, EXEMPLARS, STREET_VIEWS)


def exemplar_folder(file_name: str) -> str:
    """Return the folder of a prepared exemplar, by the name of its file: no two of a block are equal."""
    return f"{EXEMPLARS}/{hashlib.blake2b(file_name.encode(), digest_size=8).hexdigest()}"


def street_view_path(street: str, number: int) -> str:
    """Return the path of what a viewpoint decided, by the id of its street and its number along it."""
    return f"{STREET_VIEWS}/{hashlib.blake2b(street.encode(), digest_size=8).hexdigest()}/{number}"


def variation_hierarchy_path(chart: int) -> str:
    """Return the store path of a facade's encoded variation hierarchy, by its chart's id."""
    return f"{HIERARCHIES}/{chart:016x}"


def earlier_picture_path(chart: int) -> str:
    """Return the path of a facade's earlier picture, by the id of its chart."""
    return f"{EARLIER}/{chart:016x}"


def page_picture_path(page: int) -> str:
    """Return the store path of an atlas page's encoded picture."""
    return f"{PAGES}/{page}"


def tile_paths(name: str) -> tuple[str, str]:
    """Return the paths of a tile's model and of its coarse rasters."""
    return f"{TILES}/{name}", f"{COARSE}/{name}"


def picture_path(name: str) -> str:
    """Return the path of a picture, or of a facade's pictures."""
    return f"{PICTURES}/{name}"


def write_stored_file(group: StoreGroup, path: str, data: bytes, long_name: str) -> None:
    """Write a file to the store, replacing an earlier one."""
    group.create_array(
        path,
        data=np.frombuffer(data, np.uint8),
        chunks=(max(1, len(data)),),
        compressors=None,
        # unique per file: xarray opens a folder as one dataset, and files differ in length
        dimension_names=(re.sub(r"\W", "_", f"byte_of_{path}"),),
        attributes={"long_name": long_name},
        overwrite=True,
    )


def read_stored_file(group: StoreGroup, path: str, digest: str) -> bytes:
    """Return a file of the store.

    Raises
    ------
    StoreError
        The file is missing, or its digest differs.
    """
    return read_verified_array(group, path, digest).tobytes()


def read_verified_array(group: StoreGroup, path: str, digest: str) -> UInt8Array:
    """Return a stored file or coarse raster as an array, after its digest is checked.

    Raises
    ------
    StoreError
        The file is missing, or its digest differs.
    """
    if path not in group:
        raise StoreError(f"{path} is not in the store; the next run makes it again")
    data = np.asarray(group[path][:])
    if digest_stored_file(np.ascontiguousarray(data).data) != digest:
        raise StoreError(f"{path} is not as it was written; the next run makes it again")
    return data


def digest_stored_file(data: bytes | memoryview) -> str:
    """Compute the SHA-256 of a file's bytes, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def delete_stored_files_except(group: StoreGroup, kept: Collection[str]) -> None:
    """Delete the files of all folders except those at the `kept` paths."""
    for folder in FOLDERS:
        for path in _list_arrays(get_subgroup(group, folder), folder):
            if path not in kept:
                del group[path]


def _list_arrays(group: StoreGroup, folder: str) -> list[str]:
    """List the paths of the arrays in a group, whose own path is `folder`, and in groups within."""
    within = [path for name, one in list(group.groups()) for path in _list_arrays(one, f"{folder}/{name}")]
    return [*(f"{folder}/{name}" for name, _ in list(group.arrays())), *within]
