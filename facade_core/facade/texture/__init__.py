"""Facade textures: synthesis, retargeting and inpainting (tiles and floors papers)."""
