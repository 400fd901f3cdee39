"""Encode the pages of the atlas."""
