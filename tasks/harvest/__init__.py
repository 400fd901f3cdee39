"""Harvest of a style library from unposed street pictures."""

# Exemplars of a style library, by default.
MAX_EXEMPLARS = 40
