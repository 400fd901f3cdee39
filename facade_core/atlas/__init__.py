"""Texture atlas in chunked zarr: arrays, store, journal and rasters."""

from facade_core.atlas.snapshot import Atlas, open_atlas

__all__ = ["Atlas", "open_atlas"]
