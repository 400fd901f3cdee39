"""Training of the facade parser."""
