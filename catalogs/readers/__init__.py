"""Readers of input files: one file format each, with results of the types in catalogs.features."""
