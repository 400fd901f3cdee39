"""Facade rasters from imagery: posed panoramas, and textures that a model brings along."""

from facade_core.rectify.fusion import Fused, View, fuse_views
from facade_core.rectify.own_texture import own_texture
from facade_core.rectify.panorama import Sighting, panoramas_near, rectify_view, sightings
from facade_core.rectify.photo import Rectified, rectify
from facade_core.rectify.refinement import Refined, refine_pose

__all__ = [
    "Fused",
    "Rectified",
    "Refined",
    "Sighting",
    "View",
    "fuse_views",
    "own_texture",
    "panoramas_near",
    "rectify",
    "rectify_view",
    "refine_pose",
    "sightings",
]
