"""Factored models: walls of repeated grain textures and shared element types."""
