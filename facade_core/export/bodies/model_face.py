"""Planar faces of a building model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Required, TypedDict

from facade_core.core.arrays import Float64Array


@dataclass(frozen=True)
class ModelFace:
    """Planar face of a building model with its semantic surface and texture.

    Attributes
    ----------
    rings : (k, 3) corners, exterior first, unclosed, counter-clockwise as seen from outside, world metres.
    semantic : index of its semantic surface.
    uv : (k, 2) texture coordinates of each ring, u right and v up.
    page : texture page; None without.
    """

    rings: tuple[Float64Array, ...]
    semantic: int
    uv: tuple[Float64Array, ...] = ()
    page: int | None = None


class SemanticSurface(TypedDict, total=False):
    """Semantic surface of CityJSON 2.0; `parent` and `children` are indices in the same list."""

    type: Required[str]
    parent: int
    children: list[int]
    facade: str
    isFacade: bool
