"""A procedural painter of facades with ground truth: demo input, test input, training input."""

from .exemplars import exemplars
from .facade import PaintedFacade, facade
from .styles import STYLES

__all__ = ["STYLES", "PaintedFacade", "exemplars", "facade"]
