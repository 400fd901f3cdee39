"""What stands around in the block's frame: objects on the ground, from OpenStreetMap tags, and neighbouring buildings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import shapely

from catalogs.buildings.assembly import assemble_buildings
from catalogs.features import BuildingModels, Footprints
from catalogs.readers.vectors.lengths import parse_length
from facade_core.core.street_objects import stated_object_kind
from facade_core.core.types import Building, GroundObject, MappedGround

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon
    from shapely.geometry.base import BaseGeometry

# Distance from the area of a block to the farthest neighbour.
NEIGHBOUR_DISTANCE_M = 150.0
# Values of `building` that do not make a building with walls of an object.
_OPEN_BUILDINGS = ("", "no", "roof", "carport")
_COMPASS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")
_DEGREES_BY_WORD = {name: 22.5 * index for index, name in enumerate(_COMPASS)} | {
    word: 90.0 * index for index, word in enumerate(("NORTH", "EAST", "SOUTH", "WEST"))
}


def build_ground_objects(
    id: str, geometry: BaseGeometry, tags: Mapping[str, str], around: Polygon
) -> list[GroundObject]:
    """Build the objects that a feature states within a polygon: one, or one for each part of a line.

    Parameters
    ----------
    id : id of the feature.
    geometry : in the block's frame.
    tags : OpenStreetMap tags.
    around : polygon that objects lie in.
    """
    kind = stated_object_kind(tags)
    if kind is None or tags.get("building", "") not in _OPEN_BUILDINGS:
        return []
    is_line = kind.is_joined or tags.get("natural") == "tree_row"
    if is_line and "Polygon" in geometry.geom_type and tags.get("area") != "yes":
        geometry = geometry.boundary
    within = shapely.force_2d(shapely.intersection(shapely.make_valid(geometry), around))
    within = shapely.get_parts(shapely.line_merge(within) if "Line" in within.geom_type else within)
    parts = [part for part in within.tolist() if not part.is_empty]
    height, width = (parse_length(tags.get(key, "")) or 0.0 for key in ("height", "width"))
    crown = parse_length(tags.get("diameter_crown", "")) or 0.0
    return [
        GroundObject(
            id if len(parts) == 1 else f"{id}-{index}",
            part,
            kind.name,
            height,
            crown or width,
            _parse_direction(tags.get("direction", "")),
        )
        for index, part in enumerate(parts)
    ]


def select_objects(ground: MappedGround, props: str) -> MappedGround:
    """Return the ground with its objects as the block key `props` asks."""
    kept = {"off": (), "stated": (True,), "plausible": (True, False)}[props]
    return replace(ground, objects=tuple(one for one in ground.objects if one.is_stated in kept))


def _parse_direction(text: str) -> float | None:
    """Return the degrees clockwise from north of a direction in degrees or as a point of the compass."""
    text = text.strip().upper().removesuffix("°")
    try:
        degrees = float(text)
    except ValueError:
        return _DEGREES_BY_WORD.get(text)
    return degrees % 360 if math.isfinite(degrees) else None


def find_neighbours(
    sources: Sequence[Footprints | BuildingModels],
    crs: CRS,
    area: Polygon | None,
    buildings: Sequence[Building],
    floor_height: float,
) -> tuple[Building, ...]:
    """Find the buildings within NEIGHBOUR_DISTANCE_M of a block's area that are not its own.

    Parameters
    ----------
    sources : footprints and models with a CRS.
    crs : metric frame of the block.
    area : area of the block in the frame; None: all buildings are the block's.
    buildings : buildings of the block.
    floor_height : metres of a storey.
    """
    if area is None:
        return ()
    wide = area.buffer(NEIGHBOUR_DISTANCE_M, quad_segs=2)
    found = assemble_buildings(sources, crs, area=wide, floor_height=floor_height).items
    ids = {building.id for building in buildings}
    own = shapely.STRtree([building.footprint for building in buildings])
    return tuple(
        one
        for one in found
        if one.id not in ids and not len(own.query(one.footprint.representative_point(), predicate="intersects"))
    )
