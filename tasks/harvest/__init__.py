"""Harvest of a style library from unposed street pictures."""
