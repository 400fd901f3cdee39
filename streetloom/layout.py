"""Completion and scores of layouts."""

from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.model import LayoutModel, load_layout_model
from facade_core.facade.layout.scores import score

__all__ = ["LayoutModel", "complete", "load_layout_model", "score"]
