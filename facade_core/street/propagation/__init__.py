"""Rendering of partially textured panoramas and texture propagation into the atlas (street paper, Eq. 1)."""
