"""In-memory part of the atlas that one street sees, with its blend state."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from facade_core.atlas.rasters import TexelLayout
from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.provenance import Provenance
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.street.propagation.blend import BlendState


@dataclass(frozen=True)
class TexelBuffer:
    """Texels of the charts that a street reads and writes.

    Writable charts come first, so that their texels have the same index in `state`.

    Attributes
    ----------
    layout : layout of the texels.
    writable : (k,) chart ids.
    colour : (t, 3) uint8, a colour or a difference: from pictures where there are any, else blended from the views by
        Eq. 1; black before the first view.
    provenance : (t,) uint8; UNSEEN before the first view.
    state : blend state of the writable texels.
    kinds : (t,) uint8 kind of surface: a texel takes pixels of its own kind alone.
    """

    layout: TexelLayout
    writable: Int64Array
    colour: UInt8Array
    provenance: UInt8Array
    state: BlendState
    kinds: UInt8Array

    @staticmethod
    def plan_layout(
        placement: ChartPlacements, writable: Iterable[int], readable: Iterable[int]
    ) -> tuple[TexelLayout, Int64Array]:
        """Plan the layout of a buffer that writes some charts and only reads others.

        Chart ids may repeat.
        """
        write = np.unique(np.fromiter(writable, np.int64))
        read = np.setdiff1d(np.fromiter(readable, np.int64), write)
        return TexelLayout.of_charts(placement, np.concatenate([write, read])), write

    @classmethod
    def allocate(
        cls,
        placement: ChartPlacements,
        rasters: TexelLayout,
        writable: Int64Array,
        base_colour: UInt8Array,
        base_provenance: UInt8Array,
        *,
        visibility_range: float = 40.0,
        kinds: UInt8Array | None = None,
    ) -> TexelBuffer:
        """Allocate a buffer without views.

        Parameters
        ----------
        placement : place of every chart on the pages.
        layout : layout from `plan_layout`.
        writable : (k,) chart ids.
        base_colour : (t, 3) colour of the base layer.
        base_provenance : (t,) provenance of the base layer.
        visibility_range : of the scene whose views the buffer takes, metres.
        kinds : (t,) kind of surface; one kind if None.
        """
        total = int((placement.width[writable].astype(np.int64) * placement.height[writable]).sum())
        state = BlendState.allocate(total, max_distance_mm=round(1000 * visibility_range))
        colour = np.where((base_provenance > Provenance.UNSEEN)[:, None], base_colour, np.uint8(0))
        one_kind = np.zeros(rasters.total, np.uint8)
        return cls(rasters, writable, colour, base_provenance.copy(), state, one_kind if kinds is None else kinds)
