"""The catalogue as a GeoPackage, for QGIS."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.published.folders import Folder
from catalogs.readers.annotations import IS_FACADE_COLUMN
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from shapely import Polygon


def write_layers(
    path: Path,
    *,
    items: Folder,
    crs: str,
    walls: Mapping[str, Polygon],
    buildings: Sequence[Mapping[str, Any]],
    roofs: Sequence[Mapping[str, Any]],
    ground: Sequence[Mapping[str, Any]],
    streets: Sequence[Mapping[str, Any]],
    chosen: Collection[str],
    no_facades: Collection[str],
    attribution: Mapping[str, str],
) -> None:
    """Write layers in the block's `crs`: facades (foot lines, with every column of the catalogue, and whether they are one),
    walls (the same as upright polygons with heights), buildings (footprints), roofs and ground (surfaces with heights),
    streets, and set_aside (units without geometry, and why).

    items: the catalogue; walls: facade -> its polygon; buildings, roofs, ground, streets: rows with a geometry; chosen: the
    buildings of which facades are written; no_facades: walls that somebody said are none; attribution: whom to name, which the
    file and each layer say in their metadata.
    A layer without rows is left out. Raises InputError for a catalogue that cannot be read.
    """
    import geopandas as gpd
    import pyarrow as pa
    import pyogrio

    try:
        rows = gpd.read_parquet(io.BytesIO(items.read_bytes()))
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{items}: cannot be read as GeoParquet; `streetloom run` publishes again") from error
    facades = rows[(rows.kind == "facade") & rows.building.isin(chosen)]
    layers = {
        "facades": facades.to_crs(crs).assign(**{IS_FACADE_COLUMN: ~facades.id.isin(no_facades)}),
        "walls": facades.set_geometry([walls.get(id) for id in facades.id], crs=crs),
        **{
            name: gpd.GeoDataFrame(list(own), geometry="geometry", crs=crs) if own else None
            for name, own in (("buildings", buildings), ("roofs", roofs), ("ground", ground), ("streets", streets))
        },
        "set_aside": rows[rows.kind != "facade"].drop(columns="geometry"),
    }
    # the file states when it was changed: as of its newest row, so that the same catalogue gives the same file
    about = dict(attribution)
    changed = rows.updated.max().strftime("%Y-%m-%dT%H:%M:%S.000Z") if len(rows) else None
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": changed})
    try:
        for name, layer in layers.items():
            if layer is not None and not layer.empty:
                pyogrio.write_dataframe(
                    layer, path, layer=name, driver="GPKG", dataset_metadata=about, layer_metadata=about
                )
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})
