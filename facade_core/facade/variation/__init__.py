"""Variation-factored encoding of facades (variation paper)."""
