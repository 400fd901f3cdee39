"""The texture atlas in chunked zarr: arrays, store, journal and rasters."""
