"""Rendered pictures of a block and of facade stages."""
