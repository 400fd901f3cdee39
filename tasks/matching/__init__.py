"""Matching of unnamed photos to facades, by way of a table that a person confirms."""
