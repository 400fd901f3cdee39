"""Write ground that panoramas show to the base layer."""
