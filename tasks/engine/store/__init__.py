"""The store of a run: commits, carry-over, integrity checks and repair."""
