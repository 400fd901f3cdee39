"""Layers of a map of the catalogue: tables with geometry, in the types that every block has."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from catalogs.published.columns import COLUMNS
from catalogs.published.folders import Folder
from catalogs.readers.annotations import IS_FACADE_COLUMN
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    import geopandas as gpd
    import pandas as pd

# Column that names the block of a city, as `streetloom query` does.
RUN_COLUMN = "run"
LAYER_NAMES = ("facades", "buildings", "roofs", "ground", "streets", "set_aside")
# Types of the columns of layers that are no rows of the catalogue: a block without a value has the type all the same.
_TYPES: Mapping[str, Mapping[str, str]] = {
    "buildings": {
        "id": "str",
        "name": "str",
        "height_m": "float64",
        "base_z": "float64",
        "top_z": "float64",
        "height_source": "str",
        "levels": "Int32",
        "roof_shape": "str",
        "roof_height_m": "float64",
        "roof_confidence": "float64",
        "wall_material": "str",
        "wall_colour": "str",
        "roof_material": "str",
        "roof_colour": "str",
    },
    "roofs": {
        "building": "str",
        "low_z": "float64",
        "high_z": "float64",
        "slope_deg": "float64",
        "area_m2": "float64",
    },
    "ground": {"low_z": "float64", "high_z": "float64", "slope_deg": "float64", "area_m2": "float64"},
    "streets": {"id": "str", "name": "str"},
}
_PANDAS_INTEGERS = {"int32": "Int32", "int64": "Int64"}


@dataclass(frozen=True)
class MapContent:
    """Content of the layers; buildings, roofs, ground and streets are rows with a geometry.

    Attributes
    ----------
    items : the catalogue.
    crs : frame of all geometries, the block's.
    walls : facade -> low_z, high_z and the foot line as geometry, with heights.
    chosen : buildings whose facades are written.
    no_facades : walls that a correction declares no facade.
    """

    items: Folder
    crs: str
    walls: Mapping[str, Mapping[str, object]]
    buildings: Sequence[Mapping[str, object]]
    roofs: Sequence[Mapping[str, object]]
    ground: Sequence[Mapping[str, object]]
    streets: Sequence[Mapping[str, object]]
    chosen: Collection[str]
    no_facades: Collection[str]


def build_map_layers(content: MapContent) -> tuple[dict[str, gpd.GeoDataFrame | pd.DataFrame], datetime | None]:
    """Build the layers of a block by LAYER_NAMES, and return the time of the newest row; empty layers are left out.

    The layers are facades (foot lines with heights, every column of the catalogue, the lowest and highest z, and whether
    they are facades), buildings (footprints), roofs and ground (surfaces with heights), streets, and set_aside (units
    without geometry, and why). An upright wall has no valid polygon on a map.

    Raises
    ------
    InputError : the catalogue cannot be read.
    """
    import geopandas as gpd
    import pandas as pd
    import pyarrow as pa

    try:
        rows = gpd.read_parquet(io.BytesIO(content.items.read_bytes()))
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{content.items}: cannot be read as GeoParquet; `streetloom run` publishes again") from error
    rows = rows.astype(
        {c.name: _PANDAS_INTEGERS[c.type] for c in COLUMNS if c.type in _PANDAS_INTEGERS and c.name in rows}
    )
    facades = rows[(rows.kind == "facade") & rows.building.isin(content.chosen)]
    walls = pd.DataFrame(
        [content.walls[id] for id in facades.id], columns=["low_z", "high_z", "geometry"], index=facades.index
    )
    layers: dict[str, gpd.GeoDataFrame | pd.DataFrame] = {
        "facades": facades.assign(
            **{"low_z": walls.low_z, "high_z": walls.high_z, IS_FACADE_COLUMN: ~facades.id.isin(content.no_facades)}
        ).set_geometry(gpd.GeoSeries(walls.geometry, crs=content.crs))
    }
    for name, types in _TYPES.items():
        listed = [dict(row) for row in getattr(content, name)]
        if listed:
            layers[name] = gpd.GeoDataFrame(
                listed, columns=[*types, "geometry"], geometry="geometry", crs=content.crs
            ).astype(dict(types))
    layers["set_aside"] = rows[rows.kind != "facade"].drop(columns="geometry")
    found = {name: layers[name] for name in LAYER_NAMES if name in layers and not layers[name].empty}
    return found, rows.updated.max().to_pydatetime() if len(rows) else None
