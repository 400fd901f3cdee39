"""Published runs in folders or buckets: their tables and reports."""
