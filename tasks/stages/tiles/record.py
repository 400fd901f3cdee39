"""Records of tiles."""

from __future__ import annotations

from typing import cast

from facade_core.atlas.journal import Record
from facade_core.atlas.stored_files import tile_paths


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


def tile_file_digests(unit: int, record: Record) -> dict[str, str]:
    """Return the stored files of a tile that is done, path -> digest."""
    tile = cast(TileRecord, record)
    return dict(zip(tile_paths(tile["unit"]), (tile["digest"], tile["coarse"]), strict=True))
