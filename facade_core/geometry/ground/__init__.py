"""Terrain, street surfaces and ground shapes."""
