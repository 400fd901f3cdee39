"""Name of the software, for `python -m streetloom`."""
