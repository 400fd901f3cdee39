"""Network of whole layouts: its input, training and use (docs/decisions/0088)."""
