"""Texture streets viewpoint by viewpoint: what pictures show of the ground is continued along them."""
