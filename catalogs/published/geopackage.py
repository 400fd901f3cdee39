"""Layers of a map as a GeoPackage with QGIS styles."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.gdal_paths import gdal_write_path
from catalogs.published.qgis_styles import STYLE_NAME, build_qml
from catalogs.reader_errors import short_message
from facade_core.core.errors import MachineError

if TYPE_CHECKING:
    import geopandas as gpd
    import pandas as pd

# Table in which QGIS looks for the styles of a GeoPackage's layers.
STYLES_TABLE = "layer_styles"
_CREATE_STYLES = f"""
    CREATE TABLE {STYLES_TABLE} (
        id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
        f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
        useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
        update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now'))
    )
"""


class GeoPackageWriter:
    """Writes layers into a new GeoPackage, one block after the other.

    Parameters
    ----------
    path : file to write.
    metadata : metadata of the file and of each layer.
    updated : time that the file states for its content, so that its bytes are reproducible; None without rows.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str], updated: datetime | None) -> None:
        self._path = path
        self._metadata = dict(metadata)
        self._time = updated.strftime("%Y-%m-%dT%H:%M:%S.000Z") if updated else None
        self._written: list[str] = []

    def append_layer(self, name: str, layer: gpd.GeoDataFrame | pd.DataFrame) -> None:
        """Append rows to a layer, which the first call creates."""
        import pyogrio

        is_new = name not in self._written
        options = {"dataset_metadata": self._metadata, "layer_metadata": self._metadata} if is_new else {}
        with self._name_write_errors(), self._fixed_time(), gdal_write_path(self._path) as target:
            pyogrio.write_dataframe(layer, target, layer=name, driver="GPKG", append=not is_new, **options)
        if is_new:
            self._written.append(name)

    def write_styles(self) -> None:
        """Write a style for each layer with a geometry."""
        styled = [(name, qml) for name in self._written if (qml := build_qml(name)) is not None]
        if not styled:
            return
        with self._name_write_errors(), closing(sqlite3.connect(self._path)) as file, file:
            file.execute(_CREATE_STYLES)
            file.execute(
                "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change)"
                " VALUES (?, 'attributes', ?, '', coalesce(?, strftime('%Y-%m-%dT%H:%M:%fZ','now')))",
                (STYLES_TABLE, STYLES_TABLE, self._time),
            )
            file.executemany(
                f"INSERT INTO {STYLES_TABLE} (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName,"
                " styleQML, styleSLD, useAsDefault, description, owner, update_time)"
                " VALUES ('', '', ?, 'geom', ?, ?, '', 1, '', '', ?)",
                [(name, STYLE_NAME, qml, self._time) for name, qml in styled],
            )

    @contextmanager
    def _name_write_errors(self) -> Iterator[None]:
        from pyogrio import errors

        try:
            yield
        except (errors.DataSourceError, errors.DataLayerError, errors.FeatureError, sqlite3.Error) as error:
            raise MachineError(
                f"{self._path}: cannot be written ({short_message(error)}); free some space, or name another place"
            ) from error

    @contextmanager
    def _fixed_time(self) -> Iterator[None]:
        import pyogrio

        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": self._time})
        try:
            yield
        finally:
            pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})
