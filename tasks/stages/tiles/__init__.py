"""Encode the tiles of the block."""
