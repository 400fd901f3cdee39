"""Folders of published runs, on this machine and in buckets: their tables and their report."""
