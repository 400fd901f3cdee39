"""What a wall shows of a library: its units, its bands, and the light on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.linear_light import linear, smoothed
from facade_core.core.types import Element
from facade_core.export.bodies.mouldings import Band, bands_of, free_of
from facade_core.export.factored.library import Library, band_like, look_of, wall_around
from facade_core.export.factored.units import units_of

# The light on a wall is meant over so much, metres.
SHADE_M = 0.4


@dataclass(frozen=True, eq=False)
class Facade:
    """A wall as it is stored: chart; seed and shown (h, w, 3) uint8, before light fell on it and after; labels (h, w);
    elements in texels, of which there are `density` a metre."""

    chart: int
    seed: np.ndarray
    shown: np.ndarray
    labels: np.ndarray
    elements: Sequence[Element]
    density: float


class Seen:
    """What a wall shows: its units, the largest first, with the library's unit that each is most like; its bands from the top,
    each with the library's band that it shows and the light on it."""

    def __init__(self, facade: Facade, library: Library) -> None:
        self.facade, self.library, density = facade, library, facade.density
        units = units_of(facade.elements, density)
        self.free = free_of(facade.labels, [unit.box for unit in units], density)
        self.light = linear(facade.shown)
        self.around = smoothed(self.light, self.free, SHADE_M * density)
        self.bands = [
            (band, band_like(library, band), self._shade(band)) for band in bands_of(facade.seed, self.free, density)
        ]
        ordered = sorted(units, key=lambda unit: (-unit.size[0] * unit.size[1], unit.box))
        around = smoothed(linear(facade.seed), self.free, SHADE_M * density)
        named = []
        for unit in ordered:
            look, wall = look_of(facade.seed, unit.box, density), wall_around(around, unit.box, density)
            named.append((unit, library.most_like(unit, look, wall)))
        self.units = [(unit, own) for unit, own in named if own is not None]

    def _shade(self, band: Band) -> np.ndarray:
        """The light (h, w, 3) of the rows of a band, each band for itself; along a moulding that of all its rows."""
        density = self.facade.density
        top = min(round(band.top * density), len(self.light) - 1)
        foot = max(top + 1, round(band.foot * density))
        light, free = self.light[top:foot], self.free[top:foot]
        if band.moulding:
            weight = free.sum(axis=0)
            mean = (light * free[..., None]).sum(axis=0) / np.maximum(weight, 1)[:, None]
            light, free = mean[None].astype(np.float32), (weight > 0)[None]
        if not free.any():
            free = np.ones_like(free)
        return smoothed(light, free, SHADE_M * density)

    def grain_at(self, y: float) -> tuple[int, np.ndarray, Band] | None:
        """The laid band nearest to a height: the library's, its light, and itself."""
        laid = [
            (max(band.top - y, y - band.foot, 0.0), own, shade, band)
            for band, own, shade in self.bands
            if own is not None and not band.moulding
        ]
        best = min(laid, key=lambda one: one[0], default=None)
        return None if best is None else (best[1], best[2], best[3])
