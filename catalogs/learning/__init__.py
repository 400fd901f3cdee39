"""Recipes of data sets that models are trained on and measured with."""
