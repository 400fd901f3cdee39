"""Parsing of rectified facades: class maps, elements, lattice, confidence and occluders."""
