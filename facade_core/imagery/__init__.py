"""Rectification, camera poses, camera views, detection and privacy of street imagery."""
