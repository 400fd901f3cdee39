"""Records of finished surfaces."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class SurfaceColourRecord(Record, total=False):
    """Record of a building or piece of ground whose colour is resolved."""

    texels: int
