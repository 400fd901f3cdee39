"""Blocks to begin with: the embedded one, public ones, and one made from a user's files."""
