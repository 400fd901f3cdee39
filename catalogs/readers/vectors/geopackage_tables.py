"""Checks of GeoPackages before GDAL opens them: a view is a program that may not terminate."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from catalogs.reader_errors import short_message
from facade_core.core.errors import InputError

# Modules of virtual tables that GDAL creates: spatial indices.
_ALLOWED_MODULES = ("rtree",)


def check_geopackage_tables(path: Path) -> None:
    """Raise InputError where views or virtual tables replace layers of a GeoPackage.

    Only the schema is read, which is a table in every file.
    """
    remedy = "write its layers as tables, e.g. with ogr2ogr"
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as file:
            file.execute("PRAGMA trusted_schema = OFF")
            found = file.execute("SELECT name, type, coalesce(sql, '') FROM sqlite_master").fetchall()
            stored = {str(name).lower(): str(kind) for name, kind, _ in found}
            if stored.get("gpkg_contents") != "table":
                raise InputError(f"{path} has no table gpkg_contents, as a GeoPackage has; {remedy}")
            layers = {str(name).lower() for (name,) in file.execute("SELECT table_name FROM gpkg_contents")}
    except sqlite3.Error as error:
        raise InputError(f"{path} cannot be read as a GeoPackage ({short_message(error)}); export it again") from error
    for name, kind, sql in found:
        words = str(sql).lower().split()
        made_up = words[:2] == ["create", "virtual"] and not any(
            f"using {module}" in " ".join(words) for module in _ALLOWED_MODULES
        )
        if (kind == "view" and (str(name).lower() in layers or str(name).lower().startswith("gpkg_"))) or made_up:
            raise InputError(f"{path}: {name} is a view or made up by a program; {remedy}")
