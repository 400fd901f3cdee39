"""Ground as posed panoramas show it: what stands in the way, one exposure for all of them, and which texels are believed."""

from facade_core.cameras.exposure import Ground, factors, look_down, usual_of
from facade_core.cameras.ground import Camera, Shown, photographed
from facade_core.cameras.standing import in_the_way

__all__ = ["Camera", "Ground", "Shown", "factors", "in_the_way", "look_down", "photographed", "usual_of"]
