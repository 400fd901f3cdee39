"""Facades as models of few pictures: a tiling material for the wall, every type of element once, geometry that places them."""
