"""Streaming reader of CityGML."""
