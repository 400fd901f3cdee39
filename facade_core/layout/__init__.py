"""Facade layouts: grids of elements and the completion of partly seen ones."""

from facade_core.layout.completion import complete
from facade_core.layout.grids import Grid, grids

__all__ = ["Grid", "complete", "grids"]
