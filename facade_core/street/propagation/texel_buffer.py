"""The part of the atlas that one street sees, in memory, with the blend state of the texels it writes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from facade_core.atlas.rasters import TexelLayout
from facade_core.core.provenance import Provenance
from facade_core.geometry.chart_packing import Placement
from facade_core.street.propagation.blend import BlendState


@dataclass(frozen=True)
class TexelBuffer:
    """Texels laid out by `rasters`, the writable charts first, so that they share their index with `state`.

    writable (k,): chart ids;
    colour (t, 3), provenance (t,) uint8: the facade stages' seed where it has evidence, elsewhere what the views make by
    Eq. 1, black and UNSEEN before the first;
    state: of the writable texels only.
    """

    rasters: TexelLayout
    writable: np.ndarray
    colour: np.ndarray
    provenance: np.ndarray
    state: BlendState

    @staticmethod
    def layout(placement: Placement, writable: Iterable[int], readable: Iterable[int]) -> tuple[TexelLayout, np.ndarray]:
        """Layout of a window that writes some charts and only reads others; chart ids may repeat."""
        write = np.unique(np.fromiter(writable, np.int64))
        read = np.setdiff1d(np.fromiter(readable, np.int64), write)
        return TexelLayout.of(placement, np.concatenate([write, read])), write

    @classmethod
    def of(
        cls,
        placement: Placement,
        rasters: TexelLayout,
        writable: np.ndarray,
        seed: np.ndarray,
        evidence: np.ndarray,
        *,
        visibility_range: float = 40.0,
    ) -> TexelBuffer:
        """A window without views yet: colour is the seed (t, 3), provenance its evidence (t,). The range, in metres, is that of
        the scene whose views it takes."""
        total = int((placement.width[writable].astype(np.int64) * placement.height[writable]).sum())
        state = BlendState.empty(total, farthest=round(1000 * visibility_range))
        colour = np.where((evidence > Provenance.UNSEEN)[:, None], seed, np.uint8(0))
        return cls(rasters, writable, colour, evidence.copy(), state)
