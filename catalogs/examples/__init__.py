"""Example blocks and their public data."""
