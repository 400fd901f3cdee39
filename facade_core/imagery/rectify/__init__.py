"""Facade rasters from photos, posed panoramas and model textures."""
