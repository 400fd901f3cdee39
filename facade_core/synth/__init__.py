"""A procedural painter of facades with ground truth: demo input, test input, training input."""

from facade_core.synth.exemplars import exemplars
from facade_core.synth.facade import PaintedFacade, facade
from facade_core.synth.styles import STYLES

__all__ = ["STYLES", "PaintedFacade", "exemplars", "facade"]
