"""Refine the pose of each panorama against the block."""
