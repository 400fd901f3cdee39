"""Procedural and example-based materials of ground, walls and roofs."""
