"""Mesh files: triangles, sorted into buildings."""
