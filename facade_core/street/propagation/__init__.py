"""Panorama rendering and texture propagation into the atlas (street paper, Eq. 1)."""
