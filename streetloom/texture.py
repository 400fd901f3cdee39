"""Textures of facades."""

from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.texture.retargeting import retarget
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.facade.texture.synthesis import synthesize

__all__ = ["exemplar_scale", "inpaint", "retarget", "synthesize"]
