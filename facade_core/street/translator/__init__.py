"""Translators of partially textured panoramas."""
