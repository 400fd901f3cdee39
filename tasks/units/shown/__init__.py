"""What pictures show of a surface, as units take it."""
