"""Records of exemplars."""

from __future__ import annotations

from typing import TypedDict

from facade_core.atlas.journal import Record


class ExemplarFacts(TypedDict, total=False):
    """Facts of a prepared exemplar, which depend on its picture and its key alone.

    Attributes
    ----------
    width_m : width at the block's density, metres.
    height_m : height, metres.
    metres_per_pixel : scale of the picture.
    metres_per_texel : scale of the stored image.
    floors : number of floors.
    columns : number of columns of windows.
    hidden : masked share.
    shaded : share of the wall in shadow.
    cut_found : whether a facade was found in the picture.
    shop_width : share of the width with shops.
    front_m : narrowest shop, metres; 0 without shops.
    look : style descriptor, `facade_core.plan.exemplar_style`.
    quality : score of the exemplar, 0 to 1.
    quality_parts : parts of the score, `facade_core.facade.exemplar_quality`.
    looked : whether faces and plates were looked for.
    style : style of a shipped exemplar; none of others.
    """

    width_m: float
    height_m: float
    metres_per_pixel: float
    metres_per_texel: float
    floors: int
    columns: int
    hidden: float
    shaded: float
    cut_found: bool
    shop_width: float
    front_m: float
    look: list[float]
    quality: float
    quality_parts: dict[str, float]
    looked: bool
    style: str


class ExemplarRecord(ExemplarFacts, Record, total=False):
    """Record of a prepared exemplar.

    Attributes
    ----------
    folder : folder of the store with its arrays.
    """

    folder: str
