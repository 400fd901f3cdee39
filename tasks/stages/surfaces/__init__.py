"""Resolve the final colour of the charts of each building and piece of ground."""
