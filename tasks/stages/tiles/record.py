"""Records of tiles."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class TileRecord(Record, total=False):
    """Record of an encoded tile.

    Attributes
    ----------
    charts : number of charts.
    shape : digest of the layout of its pictures.
    made_of : digests of the charts of each picture.
    bytes : length of the model.
    digest : digest of the model.
    box : bounding box, metres.
    coarse : digest of its coarse rasters.
    """

    charts: int
    shape: str
    made_of: list[str]
    bytes: int
    digest: str
    box: list[list[float]]
    coarse: str
