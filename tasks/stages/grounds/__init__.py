"""Grounds."""
