"""Ingest a block: geometry, facades and viewpoints into the store."""
