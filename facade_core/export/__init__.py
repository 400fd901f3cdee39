"""Textured models, tiles, city models and pictures from the atlas."""
