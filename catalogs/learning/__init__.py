"""Recipes of data sets for training and evaluation."""
