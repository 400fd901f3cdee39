"""The variation hierarchy of a facade."""

from facade_core.facade.variation.encoding import encode
from facade_core.facade.variation.hierarchy import Hierarchy

__all__ = ["Hierarchy", "encode"]
