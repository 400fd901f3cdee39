"""Catalogue as a GeoPackage, for QGIS."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.gdal_paths import gdal_write_path
from catalogs.published.folders import Folder
from catalogs.readers.annotations import IS_FACADE_COLUMN
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from shapely import Polygon


@dataclass(frozen=True)
class GeoPackageContent:
    """Content of the layers; buildings, roofs, ground and streets are rows with a geometry.

    Attributes
    ----------
    items : the catalogue.
    crs : frame of all geometries, the block's.
    walls : facade -> its polygon.
    chosen : buildings whose facades are written.
    no_facades : walls that a correction declares no facade.
    attribution : metadata that names the sources, for the file and each layer.
    """

    items: Folder
    crs: str
    walls: Mapping[str, Polygon]
    buildings: Sequence[Mapping[str, object]]
    roofs: Sequence[Mapping[str, object]]
    ground: Sequence[Mapping[str, object]]
    streets: Sequence[Mapping[str, object]]
    chosen: Collection[str]
    no_facades: Collection[str]
    attribution: Mapping[str, str]


def write_geopackage_layers(path: Path, content: GeoPackageContent) -> None:
    """Write the layers of a block into a GeoPackage; a layer without rows is left out.

    The layers are facades (foot lines with every column of the catalogue, and whether they are facades), walls (the
    same as upright polygons with heights), buildings (footprints), roofs and ground (surfaces with heights), streets,
    and set_aside (units without geometry, and why).

    Raises
    ------
    InputError : the catalogue cannot be read.
    """
    import geopandas as gpd
    import pyarrow as pa
    import pyogrio

    try:
        rows = gpd.read_parquet(io.BytesIO(content.items.read_bytes()))
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{content.items}: cannot be read as GeoParquet; `streetloom run` publishes again") from error
    facades = rows[(rows.kind == "facade") & rows.building.isin(content.chosen)]
    layers = {
        "facades": facades.to_crs(content.crs).assign(**{IS_FACADE_COLUMN: ~facades.id.isin(content.no_facades)}),
        "walls": facades.set_geometry([content.walls.get(id) for id in facades.id], crs=content.crs),
        **{
            name: gpd.GeoDataFrame(list(layer_rows), geometry="geometry", crs=content.crs) if layer_rows else None
            for name, layer_rows in (
                ("buildings", content.buildings),
                ("roofs", content.roofs),
                ("ground", content.ground),
                ("streets", content.streets),
            )
        },
        "set_aside": rows[rows.kind != "facade"].drop(columns="geometry"),
    }
    # the time of the newest row makes the file reproducible
    about = dict(content.attribution)
    changed = rows.updated.max().strftime("%Y-%m-%dT%H:%M:%S.000Z") if len(rows) else None
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": changed})
    try:
        with gdal_write_path(path) as target:
            for name, layer in layers.items():
                if layer is not None and not layer.empty:
                    pyogrio.write_dataframe(
                        layer, target, layer=name, driver="GPKG", dataset_metadata=about, layer_metadata=about
                    )
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})
