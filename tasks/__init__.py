"""Prefect tasks: open inputs, one call into facade_core, write, return a small record."""
