"""Records of textured buildings."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class TexturedBuildingRecord(Record, total=False):
    """Record of a building with textures of its own.

    Attributes
    ----------
    charts : number of charts.
    """

    charts: int
