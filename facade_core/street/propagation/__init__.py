"""Rendering of partially textured panoramas and their propagation into the atlas (street paper, Eq. 1)."""
