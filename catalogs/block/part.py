"""A block that is a part of a city: of all that the city's files hold, what is its own, and as much around it as it reads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.block.keys import PartKeys
from catalogs.block.segments import segments
from catalogs.features import file_stem
from facade_core.types import Building, Ground, Street

if TYPE_CHECKING:
    from catalogs.block.reading import Block

# A map puts a shop into its building, or so far before it, metres.
SHOP_M = 15.0
# Ground is drawn of ways and areas that come so near to what the block holds; pictures are of use that were taken so near to a
# building of its own. Metres.
GROUND_M, PICTURE_M = 120.0, 150.0


@dataclass(frozen=True)
class Part:
    """What of a block is its own where it is a part of a city; all else in it is context, which is seen and not textured.

    buildings, streets: ids. beyond: buildings farther away, before whose choice of an exemplar none of the block's own can be
    made. fronts: the name of the street next to each of the block's own buildings, then of those beyond; shops: which of
    these have a shop (1, 0; -1 where no map tells), likewise.
    """

    buildings: tuple[str, ...]
    streets: tuple[str, ...]
    beyond: tuple[Building, ...]
    fronts: tuple[str, ...]
    shops: tuple[int, ...]


def restricted(block: Block, keys: PartKeys) -> Block:
    """The part of a city that `keys` names, of the whole of it.

    Raises ValueError, "part.KEY: problem; remedy", for an id that the city does not have.
    """
    buildings = {building.id: building for building in block.buildings}
    cut = {street.id: street for street in segments(block.streets)}
    for name, ids, known in (
        ("buildings", [*keys.buildings, *keys.context, *keys.beyond], buildings),
        ("streets", [*keys.streets, *keys.passing], cut),
    ):
        if unknown := [one for one in ids if one not in known]:
            raise ValueError(
                f"part.{name}: {unknown[0]} is not in the city any more; `streetloom city` cuts it again by itself"
            )
    own, held = set(keys.buildings), {*keys.buildings, *keys.context}
    kept = tuple(building for building in block.buildings if building.id in held)
    lines = tuple(street for street in cut.values() if street.id in {*keys.streets, *keys.passing})
    mine = [building for building in block.buildings if building.id in own]
    named = [*mine, *(buildings[one] for one in keys.beyond)]
    part = Part(
        tuple(building.id for building in mine),
        tuple(street.id for street in lines if street.id in set(keys.streets)),
        tuple(buildings[one] for one in keys.beyond),
        tuple(fronts_of(named, tuple(cut.values()))),
        tuple(with_shops(named, block.buildings, block.shops)),
    )
    around = shapely.box(
        *shapely.total_bounds([*(one.footprint for one in kept), *(one.line for one in lines)])
    ).buffer(GROUND_M, join_style="mitre")
    near = shapely.union_all([one.footprint for one in mine]).buffer(PICTURE_M)
    return replace(
        block,
        buildings=kept,
        streets=lines,
        shops=None,
        ground=_ground(block.ground, around),
        photos={name: path for name, path in block.photos.items() if _of_own(name, own)},
        panoramas=tuple(one for one in block.panoramas if near.covers(shapely.Point(one.pose.x, one.pose.y))),
        notes=(),
        faults=tuple(fault for fault in block.faults if fault.kind not in ("building", "street", "photo")),
        part=part,
    )


def fronts_of(buildings: Sequence[Building], streets: Sequence[Street]) -> list[str]:
    """The name, else the id, of the street that is nearest to each building."""
    if not streets:
        return [""] * len(buildings)
    tree = shapely.STRtree([street.line for street in streets])
    nearest: dict[int, list[int]] = {}
    of, found = tree.query_nearest([building.footprint for building in buildings], all_matches=True)
    for building, street in zip(of.tolist(), found.tolist(), strict=True):
        nearest.setdefault(building, []).append(street)
    return [min(streets[one].name or streets[one].id for one in nearest[i]) for i in range(len(buildings))]


def with_shops(
    chosen: Sequence[Building], every: Sequence[Building], places: Sequence[tuple[float, float]] | None
) -> list[int]:
    """Whether each of some of a city's buildings has a shop: 1, or 0; -1 where no map tells."""
    if places is None:
        return [-1] * len(chosen)
    tree = shapely.STRtree([building.footprint for building in every])
    points = shapely.points(np.array(places).reshape(-1, 2))
    at = tree.query_nearest(points, max_distance=SHOP_M)[1]
    found = {every[index].id for index in at.tolist()}
    return [int(building.id in found) for building in chosen]


def _ground(ground: Ground, around: shapely.Polygon) -> Ground:
    def near(things: Iterable, shapes: Sequence) -> tuple:
        meets = shapely.intersects(np.array(shapes, object), around) if len(shapes) else ()
        return tuple(thing for thing, one in zip(things, meets, strict=True) if one)

    return replace(
        ground,
        ways=near(ground.ways, [way.line for way in ground.ways]),
        areas=near(ground.areas, [area.outline for area in ground.areas]),
    )


def _of_own(facade: str, own: set[str]) -> bool:
    """Whether a facade, as a photo names it, is of one of some buildings."""
    building = facade.rpartition("-")[0]
    return building in own or building in set(map(file_stem, own))
