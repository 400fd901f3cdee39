"""Input and output of Streetloom: block files, data set recipes, and the catalogue of published runs."""

from catalogs.published.s3 import folder_at
from catalogs.query.catalogue import Catalogue, open

__all__ = ["Catalogue", "folder_at", "open"]
