"""A run's store: what is committed, taken over, forgotten, looked at and mended."""
