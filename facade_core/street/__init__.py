"""The street stage (street paper)."""
