"""Readers of mesh files, with triangles grouped into buildings."""
