"""Readers of what users have: one file format each, handing over the values of catalogs.features."""
