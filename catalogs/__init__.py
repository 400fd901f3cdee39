"""What goes in and what comes out: block files, dataset recipes, the catalogue of a block."""

from catalogs.query.opened import Catalogue, open

__all__ = ["Catalogue", "open"]
