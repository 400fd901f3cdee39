"""Publication: assembly of a snapshot from the store, and access to published snapshots."""
