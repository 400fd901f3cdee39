"""Facade models of few pictures: tiling wall material and one picture per element type."""
