"""Public import path of the variation hierarchy."""

from facade_core.facade.variation.encoding import encode
from facade_core.facade.variation.hierarchy import Hierarchy

__all__ = ["Hierarchy", "encode"]
