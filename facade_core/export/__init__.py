"""Out of the atlas into what people open: textured models and pictures."""

from facade_core.export.camera import Camera, aerial, street_level
from facade_core.export.hidden import draw_cut, overlay_hidden
from facade_core.export.picture import Picture, aim, draw_facade, draw_layout, perspective

__all__ = [
    "Camera",
    "Picture",
    "aerial",
    "aim",
    "draw_cut",
    "draw_facade",
    "draw_layout",
    "overlay_hidden",
    "perspective",
    "street_level",
]
