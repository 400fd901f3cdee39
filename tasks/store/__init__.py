"""A run's store: the plan in it, what is committed, taken over, forgotten, and mended."""
