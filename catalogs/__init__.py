"""What goes in and what comes out: block files, dataset recipes, the catalogue of a block."""

from catalogs.published.s3 import folder_at
from catalogs.query.catalogue import Catalogue, open

__all__ = ["Catalogue", "folder_at", "open"]
