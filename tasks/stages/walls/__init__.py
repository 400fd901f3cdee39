"""Write walls and roofs that panoramas show to the base layer."""
