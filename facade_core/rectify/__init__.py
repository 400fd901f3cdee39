"""Facade rasters from imagery: posed panoramas, and textures that a model brings along."""

from facade_core.rectify.own_texture import own_texture
from facade_core.rectify.panorama import Sighting, fuse, rectify_panorama, sightings

__all__ = ["Sighting", "fuse", "own_texture", "rectify_panorama", "sightings"]
