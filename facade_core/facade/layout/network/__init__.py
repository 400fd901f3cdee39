"""Network of whole layouts: its input, training and use (ADR 0132)."""
