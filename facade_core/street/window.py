"""The part of the atlas that one street sees, in memory, with the blend state of the texels it writes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from facade_core.atlas.provenance import resolve
from facade_core.atlas.rasters import Rasters
from facade_core.geometry.packing import Placement
from facade_core.street.blend import BlendState, blend


@dataclass(frozen=True)
class Window:
    """Texels laid out by `rasters`, the writable charts first, so that they share their index with `state`.

    writable (k,) chart ids; seed (t, 3) and evidence (t,) uint8 from the facade stages; colour (t, 3) and provenance (t,) uint8
    resolved, kept up to date by `refresh`; state holds the writable texels only.
    """

    rasters: Rasters
    writable: np.ndarray
    seed: np.ndarray
    evidence: np.ndarray
    colour: np.ndarray
    provenance: np.ndarray
    state: BlendState

    @staticmethod
    def layout(placement: Placement, writable: Iterable[int], readable: Iterable[int]) -> tuple[Rasters, np.ndarray]:
        """Layout of a window that writes some charts and only reads others; chart ids may repeat."""
        write = np.unique(np.fromiter(writable, np.int64))
        read = np.setdiff1d(np.fromiter(readable, np.int64), write)
        return Rasters.of(placement, np.concatenate([write, read])), write

    @classmethod
    def of(
        cls, placement: Placement, rasters: Rasters, writable: np.ndarray, seed: np.ndarray, evidence: np.ndarray
    ) -> Window:
        """A window without views yet: colour is the seed."""
        size = placement.width[writable].astype(np.int64) * placement.height[writable]
        return cls(rasters, writable, seed, evidence, seed.copy(), evidence.copy(), BlendState.empty(int(size.sum())))

    def refresh(self, placement: Placement, charts: np.ndarray) -> None:
        """Resolve colour and provenance of some writable charts again, in place."""
        for chart in charts:
            texels = self.rasters.slice(placement, int(chart))
            street, views = blend(self.state, texels)
            colour, provenance = resolve(self.seed[texels], self.evidence[texels], street, views)
            self.colour[texels] = colour
            self.provenance[texels] = provenance
