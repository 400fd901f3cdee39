"""Surfaces as posed panoramas show them: what stands in the way, one exposure for all, and which texels are believed."""

from facade_core.cameras.exposure import Ground, factors, look_down, usual_of
from facade_core.cameras.ground import photographed
from facade_core.cameras.shown import Camera, Shown
from facade_core.cameras.standing import before_buildings, beside_edges, in_the_way
from facade_core.cameras.walls import photographed_wall

__all__ = [
    "Camera",
    "Ground",
    "Shown",
    "before_buildings",
    "beside_edges",
    "factors",
    "in_the_way",
    "look_down",
    "photographed",
    "photographed_wall",
    "usual_of",
]
