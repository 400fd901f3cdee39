"""Public import path of layout completion."""

from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.scores import score

__all__ = ["complete", "score"]
