"""Readers of pictures and rasters: photos, posed panoramas, orthophotos and elevation models."""
