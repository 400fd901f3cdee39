"""Rectification of photos."""

from facade_core.imagery.rectify.photo import Rectified, rectify

__all__ = ["Rectified", "rectify"]
