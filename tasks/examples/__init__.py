"""Example blocks: an embedded one, public ones, and new ones from a user's files."""
