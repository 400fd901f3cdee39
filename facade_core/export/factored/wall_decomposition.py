"""What a wall shows of a library: its units, its bands, and the light on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.linear_light import smooth_known, srgb_to_linear
from facade_core.core.types import Element
from facade_core.export.bodies.mouldings import WallBand, free_wall_mask, segment_bands
from facade_core.export.factored.library import (
    FacadeLibrary,
    find_similar_band,
    surrounding_wall_light,
    unit_descriptor,
)
from facade_core.export.factored.units import group_units

# Smoothing of the light on a wall, metres.
SHADE_SMOOTHING_M = 0.4


@dataclass(frozen=True, eq=False)
class FactoredFacade:
    """A wall as it is stored: chart; seed and shown (h, w, 3) uint8, before light fell on it and after; labels (h, w);
    elements in texels, of which there are `density` a metre."""

    chart: int
    base_layer: np.ndarray
    colour: np.ndarray
    labels: np.ndarray
    elements: Sequence[Element]
    density: float


class WallDecomposition:
    """What a wall shows: its units, the largest first, with the library's unit that each is most like; its bands from the top,
    each with the library's band that it shows and the light on it."""

    def __init__(self, facade: FactoredFacade, library: FacadeLibrary) -> None:
        self.facade, self.library, density = facade, library, facade.density
        units = group_units(facade.elements, density)
        self.free = free_wall_mask(facade.labels, [unit.box for unit in units], density)
        self.light = srgb_to_linear(facade.colour)
        self.wall_light = smooth_known(self.light, self.free, SHADE_SMOOTHING_M * density)
        self.bands = [
            (band, find_similar_band(library, band), self._band_light(band))
            for band in segment_bands(facade.base_layer, self.free, density)
        ]
        ordered = sorted(units, key=lambda unit: (-unit.size[0] * unit.size[1], unit.box))
        around = smooth_known(srgb_to_linear(facade.base_layer), self.free, SHADE_SMOOTHING_M * density)
        named = []
        for unit in ordered:
            look, wall = (
                unit_descriptor(facade.base_layer, unit.box, density),
                surrounding_wall_light(around, unit.box, density),
            )
            named.append((unit, library.find_similar_unit(unit, look, wall)))
        self.units = [(unit, own) for unit, own in named if own is not None]

    def _band_light(self, band: WallBand) -> np.ndarray:
        """The light (h, w, 3) of the rows of a band, each band for itself; along a moulding that of all its rows."""
        density = self.facade.density
        top = min(round(band.top * density), len(self.light) - 1)
        foot = max(top + 1, round(band.foot * density))
        light, free = self.light[top:foot], self.free[top:foot]
        if band.is_moulding:
            weight = free.sum(axis=0)
            mean = (light * free[..., None]).sum(axis=0) / np.maximum(weight, 1)[:, None]
            light, free = mean[None].astype(np.float32), (weight > 0)[None]
        if not free.any():
            free = np.ones_like(free)
        return smooth_known(light, free, SHADE_SMOOTHING_M * density)

    def nearest_grain(self, y: float) -> tuple[int, np.ndarray, WallBand] | None:
        """The laid band nearest to a height: the library's, its light, and itself."""
        laid = [
            (max(band.top - y, y - band.foot, 0.0), own, shade, band)
            for band, own, shade in self.bands
            if own is not None and not band.is_moulding
        ]
        best = min(laid, key=lambda one: one[0], default=None)
        return None if best is None else (best[1], best[2], best[3])
