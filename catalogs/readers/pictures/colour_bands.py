"""Bands of a raster that hold its colours, as the raster states them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

_COLOURS = ("red", "green", "blue")
# Meanings by the words of descriptions; the first that matches counts.
_MEANINGS = {
    "infrared": re.compile(r"\b(nir\d*|ir|cir|infra-?red|near[- ]infra-?red|(red[- ]?edge|re)\d*)\b", re.IGNORECASE),
    "alpha": re.compile(r"\b(alpha|a|mask|opacity)\b", re.IGNORECASE),
    "red": re.compile(r"\b(red|r|rot|rood|rouge)\b", re.IGNORECASE),
    "green": re.compile(r"\b(green|g|gr[uü]n|groen|vert)\b", re.IGNORECASE),
    "blue": re.compile(r"\b(blue|b|blau|blauw|bleu)\b", re.IGNORECASE),
}


class ColourBands(NamedTuple):
    """Numbers of the bands from 1: red, green and blue, or one of grey or a palette.

    Attributes
    ----------
    colours : numbers of the colours.
    alpha : number of the band of opacity; None without one.
    is_assumed : True where the raster does not state the colours of its bands.
    """

    colours: tuple[int, ...]
    alpha: int | None = None
    is_assumed: bool = False


def find_colour_bands(raster: DatasetReader, name: str) -> ColourBands:
    """Return the bands of the colours: by their descriptions, else by their colour interpretation, else the first ones.

    Parameters
    ----------
    raster : open raster.
    name : its name in messages.

    Raises
    ------
    InputError
        Where the descriptions name bands that make no natural colours.
    """
    described = [_described_meaning(text or "") for text in raster.descriptions]
    interpreted = [how.name for how in raster.colorinterp]
    is_described = not {*_COLOURS, "infrared"}.isdisjoint(described)
    meanings = [stated or (how if how == "alpha" else "") for stated, how in zip(described, interpreted, strict=True)]
    meanings = meanings if is_described else interpreted
    alpha = 1 + meanings.index("alpha") if "alpha" in meanings else None
    if set(_COLOURS) <= set(meanings):
        return ColourBands(tuple(1 + meanings.index(colour) for colour in _COLOURS), alpha)
    if raster.count > 1 and not {*_COLOURS, "infrared"}.isdisjoint(meanings):
        bands = ", ".join(text or how for text, how in zip(raster.descriptions, interpreted, strict=True))
        raise InputError(
            f"{name} has the bands {bands}, and not each of red, green and blue; give a picture in natural colours"
        )
    others = [number for number in range(1, raster.count + 1) if number != alpha]
    if len(others) < 3:
        return ColourBands((others[0] if others else 1,), alpha)
    return ColourBands(tuple(others[:3]), alpha, is_assumed=True)


def _described_meaning(text: str) -> str:
    words = text.replace("_", " ")
    return next((meaning for meaning, pattern in _MEANINGS.items() if pattern.search(words)), "")
