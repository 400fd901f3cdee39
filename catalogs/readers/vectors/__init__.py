"""Readers of vector files and OpenStreetMap extracts: footprints and centrelines with tags."""
