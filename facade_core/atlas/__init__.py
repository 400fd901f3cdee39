"""The texture atlas in chunked zarr (Icechunk): its shape, its store, its journal and what wins on a texel."""

from facade_core.atlas.arrays import FORMAT, create_arrays
from facade_core.atlas.journal import Record, atlas_digest, latest_digests, read_journal, unit_key, write_record
from facade_core.atlas.opened import Atlas, open_atlas
from facade_core.atlas.provenance import (
    INPAINTED,
    MATERIAL,
    PHOTO,
    PROVENANCE,
    SYNTHESISED,
    TRANSLATED,
    UNSEEN,
    resolve,
)
from facade_core.atlas.rasters import Rasters, chart_digests, chunk_digests, read_rasters, write_rasters
from facade_core.atlas.spec import AtlasSpec
from facade_core.atlas.store import commit, expire, open_repository, open_root, open_table, write_table

__all__ = [
    "FORMAT",
    "INPAINTED",
    "MATERIAL",
    "PHOTO",
    "PROVENANCE",
    "SYNTHESISED",
    "TRANSLATED",
    "UNSEEN",
    "Atlas",
    "AtlasSpec",
    "Rasters",
    "Record",
    "atlas_digest",
    "chart_digests",
    "chunk_digests",
    "commit",
    "create_arrays",
    "expire",
    "latest_digests",
    "open_atlas",
    "open_repository",
    "open_root",
    "open_table",
    "read_journal",
    "read_rasters",
    "resolve",
    "unit_key",
    "write_rasters",
    "write_record",
    "write_table",
]
