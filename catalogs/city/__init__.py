"""City files, and the partition of cities into blocks."""
