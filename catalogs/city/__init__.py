"""Cities: their files, and how they are cut into blocks."""
