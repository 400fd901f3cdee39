"""A procedural painter of facades with ground truth: demo input, test input, training input."""

from facade_core.synth.exemplars import exemplar, exemplars
from facade_core.synth.facade import PaintedFacade, facade
from facade_core.synth.styles import NORDIC, STYLES

__all__ = ["NORDIC", "STYLES", "PaintedFacade", "exemplar", "exemplars", "facade"]
