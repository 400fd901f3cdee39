"""Texture streets viewpoint by viewpoint, and blend their panoramas into the atlas."""
