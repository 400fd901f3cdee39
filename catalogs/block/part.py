"""Part of a city as a block: its own buildings and streets, and the surroundings that it reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.block.likely_shops import MAX_SHOP_DISTANCE_M
from catalogs.block.segments import split_streets_at_junctions
from catalogs.features import safe_file_stem, select_textures
from facade_core.core.types import Building, MappedGround, Street

if TYPE_CHECKING:
    from pathlib import Path

    from catalogs.block.reader import Block

# Distance of a mapped entrance from its wall: maps put it on the outline.
MAX_ENTRANCE_DISTANCE_M = 1.5
# Margin around the block's contents for ways and areas of the ground.
PART_GROUND_MARGIN_M = 120.0
# Distance of panoramas from the block's own buildings.
MAX_PICTURE_DISTANCE_M = 150.0


@dataclass(frozen=True)
class CityPart:
    """Own buildings and streets of a block that is a part of a city.

    Other contents of the block are seen but not textured.

    Attributes
    ----------
    buildings, streets : ids of the own ones.
    distant_buildings : buildings farther away whose exemplar must be chosen before one of the block's own.
    front_streets : name of the nearest street of each own building, then of each distant one.
    shop_flags : 1 if the building has a shop, 0 if not, -1 without a map; in the same order.
    """

    buildings: tuple[str, ...]
    streets: tuple[str, ...]
    distant_buildings: tuple[Building, ...]
    front_streets: tuple[str, ...]
    shop_flags: tuple[int, ...]


@dataclass(frozen=True)
class CityPartIds:
    """Ids of a city's buildings and street segments that belong to one block, in the city's order.

    Attributes
    ----------
    name : name of the block.
    buildings, streets : the block's own.
    halo_buildings, halo_streets : those around it.
    distant_buildings : buildings whose exemplar must be chosen before one of the block's own.
    """

    name: str
    buildings: tuple[str, ...]
    streets: tuple[str, ...]
    halo_buildings: tuple[str, ...] = ()
    halo_streets: tuple[str, ...] = ()
    distant_buildings: tuple[str, ...] = ()


class CityIndex:
    """City read as one block, with the look-ups that every part needs, computed once.

    Attributes
    ----------
    segments : streets cut at junctions.
    front_streets : name of the street nearest to each building.
    shop_flags : as in `CityPart`, in the order of the buildings.
    """

    def __init__(self, block: Block) -> None:
        self.block = block
        self.segments = split_streets_at_junctions(block.streets)
        self.front_streets = nearest_street_names(block.buildings, self.segments)
        self.shop_flags = _shop_flags(block.buildings, block.shops)
        self._building = {building.id: index for index, building in enumerate(block.buildings)}
        self._segment = {street.id: index for index, street in enumerate(self.segments)}
        self._photos: dict[str, list[str]] = {}
        for facade in block.photos:
            self._photos.setdefault(facade.rpartition("-")[0], []).append(facade)
        places = [shapely.Point(one.pose.x, one.pose.y) for one in block.panoramas]
        self._entrances = shapely.STRtree(shapely.points(np.array(block.entrances).reshape(-1, 2)))
        self._panoramas = shapely.STRtree(places)
        self._ways = shapely.STRtree([way.line for way in block.ground.ways])
        self._areas = shapely.STRtree([area.outline for area in block.ground.areas])

    def extract_part(self, selection: CityPartIds) -> Block:
        """Build the block of one part of the city."""
        block = self.block
        own = sorted(self._building[one] for one in selection.buildings)
        mine = [block.buildings[i] for i in own]
        kept = [block.buildings[i] for i in sorted({*own, *(self._building[one] for one in selection.halo_buildings)})]
        walked = {self._segment[one] for one in selection.streets}
        lines = [self.segments[i] for i in sorted({*walked, *(self._segment[one] for one in selection.halo_streets)})]
        beyond = [self._building[one] for one in selection.distant_buildings]
        part = CityPart(
            tuple(building.id for building in mine),
            tuple(self.segments[i].id for i in sorted(walked)),
            tuple(block.buildings[i] for i in beyond),
            tuple(self.front_streets[i] for i in (*own, *beyond)),
            tuple(self.shop_flags[i] for i in (*own, *beyond)),
        )
        extent = shapely.total_bounds([*(one.footprint for one in kept), *(one.line for one in lines)])
        around = shapely.box(*extent).buffer(PART_GROUND_MARGIN_M, join_style="mitre")
        footprints = shapely.union_all([one.footprint for one in mine])
        pictured = np.sort(self._panoramas.query(footprints.buffer(MAX_PICTURE_DISTANCE_M), predicate="covers"))
        entrances = np.sort(self._entrances.query(footprints.buffer(MAX_ENTRANCE_DISTANCE_M), predicate="covers"))
        kept, textures = select_textures(kept, block.textures)
        return replace(
            block,
            buildings=tuple(kept),
            streets=tuple(lines),
            shops=None,
            entrances=tuple(block.entrances[i] for i in entrances.tolist()),
            ground=self._ground_around(around),
            photos=self._select_photos(mine),
            panoramas=tuple(block.panoramas[i] for i in pictured.tolist()),
            textures=textures,
            notes=(),
            faults=tuple(fault for fault in block.faults if fault.kind not in ("building", "street", "photo")),
            part=part,
        )

    def _select_photos(self, buildings: Sequence[Building]) -> dict[str, Path]:
        """Return the photos of the facades of some buildings, which file names may give by their stem."""
        names = {name for one in buildings for name in (one.id, safe_file_stem(one.id))}
        facades = {facade for name in names for facade in self._photos.get(name, ())}
        return {facade: self.block.photos[facade] for facade in sorted(facades)}

    def _ground_around(self, around: shapely.Polygon) -> MappedGround:
        ground = self.block.ground
        ways, areas = (np.sort(tree.query(around, predicate="intersects")) for tree in (self._ways, self._areas))
        return replace(
            ground,
            ways=tuple(ground.ways[i] for i in ways.tolist()),
            areas=tuple(ground.areas[i] for i in areas.tolist()),
        )


def nearest_street_names(buildings: Sequence[Building], streets: Sequence[Street]) -> list[str]:
    """Return the name, or else the id, of the street nearest to each building."""
    if not streets:
        return [""] * len(buildings)
    tree = shapely.STRtree([street.line for street in streets])
    nearest: dict[int, list[int]] = {}
    of, found = tree.query_nearest([building.footprint for building in buildings], all_matches=True)
    for building, street in zip(of.tolist(), found.tolist(), strict=True):
        nearest.setdefault(building, []).append(street)
    return [min(streets[one].name or streets[one].id for one in nearest[i]) for i in range(len(buildings))]


def _shop_flags(buildings: Sequence[Building], places: Sequence[tuple[float, float]] | None) -> list[int]:
    """Return 1 for each building with a shop and 0 for others; -1 without a map."""
    if places is None:
        return [-1] * len(buildings)
    tree = shapely.STRtree([building.footprint for building in buildings])
    at = tree.query_nearest(shapely.points(np.array(places).reshape(-1, 2)), max_distance=MAX_SHOP_DISTANCE_M)[1]
    found = set(at.tolist())
    return [int(index in found) for index in range(len(buildings))]
