"""Checks of the attribute table of a Shapefile, without which GDAL silently reads bare shapes."""

from __future__ import annotations

import struct
from pathlib import Path

from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

_HEADER_BYTES = 32  # bytes of a table's header before its fields


def check_shapefile_table(path: Path) -> None:
    """Raise InputError where the .dbf is missing, truncated or of another row count."""
    table, index = sibling_file(path, ".dbf"), sibling_file(path, ".shx")
    remedy = "copy it again from where the Shapefile came from, or export that as GeoPackage"
    if not table.is_file():
        raise InputError(f"{path} has no {table.name} beside it, which holds its ids and heights; {remedy}")
    try:
        with open_regular(table) as file:
            start = file.read(_HEADER_BYTES)
        size = table.stat().st_size
    except OSError as error:
        raise InputError(f"{table} cannot be opened ({error.strerror}); check its permissions") from error
    rows, header, row = struct.unpack_from("<IHH", start, 4) if len(start) == _HEADER_BYTES else (0, 0, 0)
    if header <= _HEADER_BYTES or not row:
        raise InputError(f"{table} is no dBASE table by its content; {remedy}")
    if size < header + rows * row:
        raise InputError(f"{table} is cut: {size} bytes of {header + rows * row}; {remedy}")
    shapes = _count_shapes(index)
    if shapes is not None and rows != shapes:
        raise InputError(f"{table} holds {rows} rows for the {shapes} shapes of {path.name}; {remedy}")


def _count_shapes(index: Path) -> int | None:
    """Return the number of shapes of an .shx; None where it is unreadable, which GDAL reports."""
    try:
        with open_regular(index) as file:
            start = file.read(28)
    except OSError:
        return None
    return (2 * int(struct.unpack_from(">i", start, 24)[0]) - 100) // 8 if len(start) == 28 else None


def sibling_file(path: Path, suffix: str) -> Path:
    """Return a file of the Shapefile with a lower- or upper-case suffix, as GDAL looks for it."""
    small, capitals = path.with_suffix(suffix), path.with_suffix(suffix.upper())
    return capitals if capitals.exists() and not small.exists() else small
