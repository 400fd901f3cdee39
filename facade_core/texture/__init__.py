"""Facade textures: synthesis from tiles, metric retargeting, inpainting of what was hidden."""

from facade_core.texture.ground_floor import without_shops
from facade_core.texture.inpainting import inpaint
from facade_core.texture.retargeting import retarget
from facade_core.texture.scale import exemplar_scale
from facade_core.texture.tiles import synthesize
from facade_core.texture.tint import tinted

__all__ = ["exemplar_scale", "inpaint", "retarget", "synthesize", "tinted", "without_shops"]
