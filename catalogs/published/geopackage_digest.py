"""Digest of a GeoPackage's content, by which an export recognises its own unchanged file.

The bytes do not serve: QGIS changes the header of a file that it only shows. The stamp is a row of the GeoPackage's
metadata, so that it stays with a file that is renamed or moved.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from catalogs.readers.geopackage_tables import check_geopackage_tables, open_geopackage
from facade_core.core.regular_files import require_regular

STAMP_URI = "urn:streetloom:export"
# Tables that SQLite, GDAL and spatial indices maintain.
_MAINTAINED = ("sqlite_", "rtree_", "gpkg_ogr_contents")


@dataclass(frozen=True)
class GeoPackageStamp:
    """Stamp of an exported GeoPackage.

    Attributes
    ----------
    digest : digest of its content when it was written.
    key : digest of what it was made from.
    """

    digest: str
    key: str


def compute_geopackage_digest(path: Path) -> str:
    """Compute a digest of all tables and rows of a GeoPackage, without its stamp.

    Raises
    ------
    InputError
        The file is no GeoPackage, or holds programs.
    """
    digest = hashlib.sha256()
    with _open(path) as file:
        tables = file.execute("SELECT name, coalesce(sql, '') FROM sqlite_master WHERE type = 'table' ORDER BY name")
        for name, sql in tables.fetchall():
            if str(name).startswith(_MAINTAINED):
                continue
            digest.update(f"{name} {sql}\n".encode())
            quoted = '"' + str(name).replace('"', '""') + '"'
            condition = f" WHERE md_standard_uri <> '{STAMP_URI}'" if name == "gpkg_metadata" else ""
            for row in file.execute(f"SELECT * FROM {quoted}{condition} ORDER BY rowid"):
                digest.update(repr(row).encode(errors="surrogatepass"))
    return digest.hexdigest()


def read_geopackage_stamp(path: Path) -> GeoPackageStamp | None:
    """Read the stamp of an exported GeoPackage; None without one.

    Raises
    ------
    InputError
        The file is no GeoPackage.
    """
    with _open(path) as file:
        if not file.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'gpkg_metadata'").fetchone():
            return None
        found = file.execute("SELECT metadata FROM gpkg_metadata WHERE md_standard_uri = ?", (STAMP_URI,)).fetchone()
    try:
        return GeoPackageStamp(**json.loads(found[0])) if found else None
    except (ValueError, TypeError):
        return None


def write_geopackage_stamp(path: Path, key: str) -> None:
    """Write the stamp into a GeoPackage that nobody else reads; nothing else may be written afterwards."""
    stamp = json.dumps({"digest": compute_geopackage_digest(path), "key": key})
    with closing(sqlite3.connect(path)) as file, file:
        file.execute(
            "INSERT INTO gpkg_metadata (md_scope, md_standard_uri, mime_type, metadata) VALUES (?, ?, ?, ?)",
            ("dataset", STAMP_URI, "application/json", stamp),
        )


@contextmanager
def _open(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a GeoPackage of tables alone for reading."""
    require_regular(path)
    check_geopackage_tables(path)
    with open_geopackage(path) as file:
        yield file
