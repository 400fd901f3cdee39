"""Pictures and rasters: photos, panoramas with their poses, orthophotos, elevation models."""
