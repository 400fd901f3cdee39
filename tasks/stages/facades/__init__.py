"""Facades."""
