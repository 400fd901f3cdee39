"""Shops, which have shop windows on the ground floor, and entrances of a map."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from catalogs.reader_errors import is_system_error
from catalogs.readers.vectors.osm_extracts import open_osm_extract
from facade_core.core.arrays import Float64Array, ObjectArray

# Amenities with shop windows; shop=* is included too.
SHOP_AMENITIES = ("bank", "bar", "cafe", "fast_food", "ice_cream", "pharmacy", "pub", "restaurant")
_VACANT_VALUES = ("no", "vacant")
# Values of `entrance` that are no visible door for visitors.
_EXCLUDED_ENTRANCES = ("no", "garage", "emergency", "exit")


class ShopsAndEntrances(NamedTuple):
    """Sorted map nodes (n, 2) in lon/lat (EPSG:4326): shops, cafes and the like; entrances."""

    shops: Float64Array
    entrances: Float64Array


def read_shops_and_entrances(path: Path) -> ShopsAndEntrances | None:
    """Read the shops and entrances of a .pbf; None where they cannot be read."""
    from pyrosm import OSM

    wanted = {"shop": True, "amenity": list(SHOP_AMENITIES), "entrance": True}
    try:
        with open_osm_extract(path) as readable:
            osm = OSM(readable, progress=False)
            frame = osm.get_data_by_custom_criteria(wanted, keep_ways=False, keep_relations=False)
    except Exception as error:  # pyrosm raises errors of zlib, struct, protobuf and its own
        if is_system_error(error):
            raise
        return None
    if frame is None:
        return ShopsAndEntrances(np.zeros((0, 2)), np.zeros((0, 2)))
    frame = frame[frame.geometry.notna()].reindex(columns=["geometry", "shop", "amenity", "entrance"])
    shops = (frame["shop"].notna() | frame["amenity"].isin(SHOP_AMENITIES)) & ~frame["shop"].isin(_VACANT_VALUES)
    entrances = frame["entrance"].notna() & ~frame["entrance"].isin(_EXCLUDED_ENTRANCES)
    return ShopsAndEntrances(
        *(_unique_coordinates(frame["geometry"][chosen].to_numpy()) for chosen in (shops, entrances))
    )


def _unique_coordinates(points: ObjectArray) -> Float64Array:
    return np.unique(shapely.get_coordinates(points).reshape(-1, 2), axis=0)
