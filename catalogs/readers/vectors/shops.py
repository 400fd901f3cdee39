"""Where a map has shops and the like: what shows a shop window on the ground floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from catalogs.broken import is_machines

# Amenities behind shop windows, beside all that is tagged shop=*.
AMENITIES = ("bank", "bar", "cafe", "fast_food", "ice_cream", "pharmacy", "pub", "restaurant")
_VACANT = ("no", "vacant")


def read_shops(path: Path) -> np.ndarray | None:
    """The nodes of a .pbf that are shops, cafes and the like, (n, 2) lon/lat (EPSG:4326), sorted; None where
    that cannot be told."""
    from pyrosm import OSM

    wanted = {"shop": True, "amenity": list(AMENITIES)}
    try:
        frame = OSM(str(path)).get_data_by_custom_criteria(wanted, keep_ways=False, keep_relations=False)
    except Exception as error:  # pyrosm lets zlib, struct, protobuf and its own errors through
        if is_machines(error):
            raise
        return None
    if frame is None:
        return np.zeros((0, 2))
    if "shop" in frame:
        frame = frame[~frame["shop"].isin(_VACANT)]
    places = shapely.get_coordinates(np.array([place for place in frame.geometry if place is not None]))
    return np.unique(places, axis=0)
