"""Journals of a store, with the record type of each stage, for readers of finished runs."""

from __future__ import annotations

from typing import TypedDict, cast

from facade_core.core.zarr_types import StoreGroup
from tasks.engine.stage import read_journals
from tasks.stages.bundles.record import BundleRecord
from tasks.stages.exemplars.record import ExemplarRecord
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.grounds.record import GroundRecord
from tasks.stages.pages.record import PageRecord
from tasks.stages.pictures.record import ReportPictureRecord
from tasks.stages.poses.record import PoseRecord
from tasks.stages.streets.record import StreetRecord
from tasks.stages.surfaces.record import SurfaceColourRecord
from tasks.stages.textures.record import TexturedBuildingRecord
from tasks.stages.tiles.record import TileRecord
from tasks.stages.walls.record import WallsAndRoofsRecord


class Journals(TypedDict):
    """Records by unit index, by stage; None for a unit without a record."""

    poses: list[PoseRecord | None]
    bundles: list[BundleRecord | None]
    exemplars: list[ExemplarRecord | None]
    textures: list[TexturedBuildingRecord | None]
    grounds: list[GroundRecord | None]
    walls: list[WallsAndRoofsRecord | None]
    facades: list[FacadeRecord | None]
    streets: list[StreetRecord | None]
    surfaces: list[SurfaceColourRecord | None]
    pages: list[PageRecord | None]
    tiles: list[TileRecord | None]
    pictures: list[ReportPictureRecord | None]


def read_typed_journals(group: StoreGroup) -> Journals:
    """Read the records of every stage."""
    return cast(Journals, read_journals(group))
