"""Decomposition of a wall into units and bands of its library, with the light on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.core.linear_light import smooth_known_light, srgb_to_linear
from facade_core.core.types import Element
from facade_core.export.bodies.mouldings import WallBand, free_wall_mask, most_similar_band, split_wall_into_bands
from facade_core.export.bodies.settings import ELEMENT_DEPTHS, element_depth
from facade_core.export.factored.library import (
    FacadeLibrary,
    surrounding_wall_light,
    unit_descriptor,
)
from facade_core.export.factored.settings import FACTORED_WALLS
from facade_core.export.factored.units import group_elements_into_units


@dataclass(frozen=True, eq=False)
class StoredFacadeWall:
    """Stored texels and elements of a facade wall that is to be factored.

    Attributes
    ----------
    chart : chart of the wall.
    base_layer : (h, w, 3) uint8 before lighting.
    colour : (h, w, 3) uint8 after lighting.
    labels : (h, w) facade classes.
    elements : elements in texels.
    density : texels per metre.
    """

    chart: int
    base_layer: UInt8Array
    colour: UInt8Array
    labels: UInt8Array
    elements: Sequence[Element]
    density: float


class WallDecomposition:
    """Units and bands of a wall with their match in the library.

    Attributes
    ----------
    units : units with the most similar unit of the library, largest first.
    bands : bands from the top, each with its match and the light on it.
    free : (h, w) bool, free wall.
    light : (h, w, 3) linear light.
    wall_light : (h, w, 3) linear light of the free wall, smoothed.
    """

    def __init__(self, facade: StoredFacadeWall, library: FacadeLibrary) -> None:
        self.facade, self.library, density = facade, library, facade.density
        units = group_elements_into_units(facade.elements, density)
        self.free = free_wall_mask(facade.labels, [unit.box for unit in units], density)
        self.light = srgb_to_linear(facade.colour)
        self.wall_light = smooth_known_light(self.light, self.free, FACTORED_WALLS.shade_smoothing_m * density)
        self.bands = [
            (band, most_similar_band(band, library.bands), self._band_light(band))
            for band in split_wall_into_bands(facade.base_layer, self.free, density)
        ]
        ordered = sorted(units, key=lambda unit: (-unit.size[0] * unit.size[1], unit.box))
        around = smooth_known_light(
            srgb_to_linear(facade.base_layer), self.free, FACTORED_WALLS.shade_smoothing_m * density
        )
        named = []
        for unit in ordered:
            look, wall = (
                unit_descriptor(facade.base_layer, unit.box, density),
                surrounding_wall_light(around, unit.box, density),
            )
            named.append((unit, library.find_similar_unit(unit, look, wall)))
        self.units = [(unit, own) for unit, own in named if own is not None]

    def _band_light(self, band: WallBand) -> Float32Array:
        """Return the light (h, w, 3) on a band; on a moulding one row, averaged over its height."""
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
        return smooth_known_light(light, free, FACTORED_WALLS.shade_smoothing_m * density)

    def recess_depth(self, place: shapely.Point) -> float:
        """Return the depth of the opening at a place behind the wall, metres; that of a window where there is none."""
        density = self.facade.density
        for e in self.facade.elements:
            if e.label != "balcony" and e.x0 <= place.x * density <= e.x1 and e.y0 <= place.y * density <= e.y1:
                return -element_depth(e, density).outward_m
        return -ELEMENT_DEPTHS["window"]

    def nearest_grain(self, y: float) -> tuple[int, Float32Array, WallBand] | None:
        """Return match, light and band of the grain band nearest to a height; None if there is none."""
        laid = [
            (max(band.top - y, y - band.foot, 0.0), own, shade, band)
            for band, own, shade in self.bands
            if own is not None and not band.is_moulding
        ]
        best = min(laid, key=lambda one: one[0], default=None)
        return None if best is None else (best[1], best[2], best[3])
