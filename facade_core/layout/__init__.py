"""Facade layouts: grids of elements, how plausible a layout is, and the completion of partly seen ones."""

from facade_core.layout.completion import complete
from facade_core.layout.grids import Grid, grids
from facade_core.layout.model import LayoutModel, load
from facade_core.layout.scores import score

__all__ = ["Grid", "LayoutModel", "complete", "grids", "load", "score"]
