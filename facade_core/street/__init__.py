"""The street stage: render a partially textured panorama, translate it, propagate it into the atlas."""

from facade_core.geometry.streets import Viewpoint, viewpoints
from facade_core.street.blend import BlendState, add_views, blend
from facade_core.street.field import Materials
from facade_core.street.propagate import propagate
from facade_core.street.render import Panorama, render
from facade_core.street.scene import Scene
from facade_core.street.translate import Swatches, Translator
from facade_core.street.window import Window

__all__ = [
    "BlendState",
    "Materials",
    "Panorama",
    "Scene",
    "Swatches",
    "Translator",
    "Viewpoint",
    "Window",
    "add_views",
    "blend",
    "propagate",
    "render",
    "viewpoints",
]
