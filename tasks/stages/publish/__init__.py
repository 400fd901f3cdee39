"""Publish a snapshot of the store."""
