"""A second opinion at run time on faces, number plates and text, by models that packages of others bring."""

from facade_core.detect.seen import Seen, look, look_on_panorama, looked_for
from facade_core.detect.signs import shop_names

__all__ = ["Seen", "look", "look_on_panorama", "looked_for", "shop_names"]
