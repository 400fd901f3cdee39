"""Facade textures: synthesis from tiles, metric retargeting, inpainting of what was hidden."""

from facade_core.texture.ground_floor import without_shops
from facade_core.texture.inpainting import inpaint
from facade_core.texture.retargeting import Style, retarget, style_of
from facade_core.texture.scale import exemplar_scale
from facade_core.texture.tiles import synthesize
from facade_core.texture.tint import tinted
from facade_core.texture.walls import Wall, on_wall

__all__ = [
    "Style",
    "Wall",
    "exemplar_scale",
    "inpaint",
    "on_wall",
    "retarget",
    "style_of",
    "synthesize",
    "tinted",
    "without_shops",
]
