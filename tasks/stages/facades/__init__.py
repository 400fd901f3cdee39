"""Rectify, parse, complete and texture the facades of each building."""
