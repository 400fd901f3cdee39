"""Refine panoramas that show the same walls together."""
