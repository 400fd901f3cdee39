"""Exemplars."""
