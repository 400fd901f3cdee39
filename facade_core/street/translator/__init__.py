"""Translators of partially textured panoramas, and their training."""
