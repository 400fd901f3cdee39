"""Records of surfaces that are taken from panoramas."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class PanoramaSurfaceRecord(Record, total=False):
    """Record of ground or walls from panoramas.

    Attributes
    ----------
    cameras : of each panorama that shows some: its name, its share of the texels, its mean distance, metres.
    """

    cameras: list[tuple[str, float, float]]
