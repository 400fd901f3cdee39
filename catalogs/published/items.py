"""Catalogue table items.parquet: one row per facade, and one per unit that was set aside.

Columns are defined here only; a test compares the README's table with them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.crs import LONLAT
from catalogs.features import natural_sort_key
from facade_core.core.arrays import ObjectArray
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    import pyarrow as pa
    from pyproj import CRS
    from shapely import LineString


@dataclass(frozen=True, slots=True)
class ItemColumn:
    """Column of the catalogue.

    Attributes
    ----------
    name : name of the column.
    type : type as pyarrow prints it.
    unit : unit of the values, empty without one.
    meaning : description.
    required : whether every row has a value.
    """

    name: str
    type: str
    unit: str
    meaning: str
    required: bool = False


def _interval_columns(name: str, type: str, unit: str = "") -> tuple[ItemColumn, ItemColumn]:
    """Return the columns of an interval meant to hold the true value in nine of ten facades.

    Measured by `bench elements`: 84 to 100 %.
    """
    least, most = (
        f"the {end} that `{name}` may be, meant to hold in nine of ten facades; none where no picture tells"
        for end in ("least", "most")
    )
    return ItemColumn(f"{name}_low", type, unit, least), ItemColumn(f"{name}_high", type, unit, most)


COLUMNS = (
    ItemColumn("id", "string", "", "unit, unique among those of its kind in the block", required=True),
    ItemColumn("block", "string", "", "name of the block", required=True),
    ItemColumn(
        "kind",
        "string",
        "",
        "facade; or building, street, surface, panorama, photo, exemplar, page, tile, picture: set aside, see reason",
        required=True,
    ),
    ItemColumn("building", "string", "", "building that the facade belongs to"),
    ItemColumn("part_of", "string", "", "id of the building of which that is a part; none of a whole one"),
    ItemColumn("geometry", "binary", "degrees", "foot line of a facade, WKB LineString in lon/lat (OGC:CRS84)"),
    ItemColumn("xmin", "double", "degrees", "west end of the foot line"),
    ItemColumn("ymin", "double", "degrees", "south end of the foot line"),
    ItemColumn("xmax", "double", "degrees", "east end of the foot line"),
    ItemColumn("ymax", "double", "degrees", "north end of the foot line"),
    ItemColumn(
        "street", "string", "", "street that sees the facade, or the nearest: its name, or its id where it has none"
    ),
    ItemColumn(
        "role",
        "string",
        "",
        "what the facade is to the streets: street, in sight of one; side, narrow and in sight; back, out of sight",
    ),
    ItemColumn("height_m", "double", "metres", "height from the ground to the eaves"),
    ItemColumn("roof_shape", "string", "", "of the building, as OpenStreetMap's `roof:shape`; none of a model"),
    ItemColumn("roof_height_m", "double", "metres", "height of the building's roof from the eaves to the ridge"),
    ItemColumn(
        "roof_confidence", "double", "0 to 1", "how sure the roof's shape is: 1 where it is stated, less where assumed"
    ),
    ItemColumn("width_m", "double", "metres", "width along the ground"),
    ItemColumn("azimuth_deg", "double", "degrees", "direction the facade faces, clockwise from north of the grid"),
    ItemColumn(
        "floors",
        "int32",
        "",
        "storeys that the facade shows, the ground floor included, and a row of windows in the roof; of one without "
        "windows `levels`",
    ),
    *_interval_columns("floors", "int32"),
    ItemColumn(
        "levels",
        "int32",
        "",
        "storeys by the map, the ground floor included: as stated, else the height over the block's storey; as many as "
        "the height can have",
    ),
    ItemColumn("columns", "int32", "", "columns of windows"),
    ItemColumn("windows", "int32", "", "windows of the completed facade"),
    *_interval_columns("windows", "int32"),
    ItemColumn("doors", "int32", "", "doors of the completed facade"),
    ItemColumn("balconies", "int32", "", "balconies of the completed facade"),
    ItemColumn(
        "shops",
        "int32",
        "",
        "stretches of shop front of the completed facade: shops side by side, with nothing between, are one",
    ),
    ItemColumn("shop_width", "double", "0 to 1", "share of the width that shop fronts take"),
    ItemColumn(
        "windows_seen",
        "int32",
        "",
        "the windows of these that pictures show; the others are made up, as all are of an exemplar",
    ),
    ItemColumn("doors_seen", "int32", "", "the same of the doors"),
    ItemColumn("balconies_seen", "int32", "", "the same of the balconies"),
    ItemColumn("shops_seen", "int32", "", "the same of the shops"),
    ItemColumn("window_to_wall", "double", "0 to 1", "window area over facade area"),
    *_interval_columns("window_to_wall", "double", "0 to 1"),
    ItemColumn("occluded", "double", "0 to 1", "share of the evidence that was hidden"),
    ItemColumn(
        "masked",
        "double",
        "0 to 1",
        "share of the evidence that things in front (trees, cars, people) hid; these were made anew",
    ),
    ItemColumn(
        "privacy",
        "string",
        "",
        "what is kept of these things in the evidence, of a facade from pictures: blur, mask or keep",
    ),
    ItemColumn(
        "shop_names",
        "string",
        "",
        'what is written over the shops of a photo, joined by "; "; none where no photo was read',
    ),
    ItemColumn("corrected", "int32", "", "1 where somebody corrected the facade, or its building, else 0"),
    ItemColumn("photo", "double", "0 to 1", "share of texels that pictures show: what of the facade is evidence"),
    ItemColumn("inpainted", "double", "0 to 1", "share of texels inpainted"),
    ItemColumn("synthesised", "double", "0 to 1", "share of texels synthesised from an exemplar"),
    ItemColumn("translated", "double", "0 to 1", "share of texels written by the translator"),
    ItemColumn("source", "string", "", "photo or exemplar that the texture comes from"),
    ItemColumn(
        "capture_date",
        "string",
        "",
        "day of the photo, or of the newest panorama, by the poses file or their EXIF",
    ),
    ItemColumn(
        "changed",
        "double",
        "0 to 1",
        "share that is another than at the capture before, of what panoramas of both show clear of things in front; none where "
        "there is one capture, or too little to tell",
    ),
    ItemColumn(
        "compared", "double", "0 to 1", "share of the facade that both show so; none where there is one capture"
    ),
    ItemColumn(
        "capture_date_before", "string", "", "day of the newest panorama of the capture before, where there is one"
    ),
    ItemColumn(
        "pose_residual_deg",
        "double",
        "degrees",
        "how far lines on walls are off their axes on the median once poses are refined: of the worst panorama that the "
        "facade is from; none where it has no lines",
    ),
    ItemColumn(
        "pose_apart_m",
        "double",
        "metres",
        "how far from each other panoramas have what they show of the same walls on the median once poses are refined "
        "together: of the worst that the facade is from; none where it shares no wall",
    ),
    ItemColumn(
        "pose_raised_m",
        "double",
        "metres",
        "by how much the height of a panorama was moved from the stated one, upwards: of the one that was moved most of "
        "those that the facade is from; none of photos",
    ),
    ItemColumn("variation_types", "int32", "", "element types of the variation hierarchy"),
    ItemColumn("variation_levels", "int32", "", "levels of the variation hierarchy"),
    ItemColumn("variation_bytes", "int64", "bytes", "size of the encoded hierarchy"),
    ItemColumn("lattice_rows", "int32", "", "horizontal lattice lines, borders included"),
    ItemColumn("lattice_columns", "int32", "", "vertical lattice lines, borders included"),
    ItemColumn("layout_score", "double", "", "score of the completed layout, higher is better"),
    ItemColumn(
        "quality",
        "string",
        "",
        "good, or what to look at: mostly-hidden, hidden-ground-floor, no-windows, unsure-parse, floors-differ, doubtful-cut, "
        "rejected-picture, height-assumed",
    ),
    ItemColumn(
        "parents", "string", "", "what it is made from: block/, building/, street/ with their ids, image/ with names"
    ),
    ItemColumn("status", "string", "", "done or failed", required=True),
    ItemColumn("reason", "string", "", "why the unit failed, or what of its pictures was refused"),
    ItemColumn("seconds", "double", "seconds", "time spent on the facade"),
    ItemColumn("updated", "timestamp[us, UTC]", "", "when the unit was made", required=True),
    ItemColumn("code_version", "string", "", "code that made the block", required=True),
    ItemColumn("config_digest", "string", "", "digest of the inputs and settings", required=True),
)
BBOX = ("xmin", "ymin", "xmax", "ymax")
# Keys of a row to be written; the box is computed from the geometry.
ROW_KEYS = tuple(column.name for column in COLUMNS if column.name not in BBOX)
STATUSES = ("done", "failed")
# Value of `quality` for a facade with an assumed height.
ASSUMED_HEIGHT = "height-assumed"
ITEM_KINDS = ("facade", "building", "street", "surface", "panorama", "photo", "exemplar", "page", "tile", "picture")
_PYTHON_TYPES: dict[str, type] = {
    "string": str,
    "binary": bytes,
    "int32": Integral,
    "int64": Integral,
    "double": Real,
    "timestamp[us, UTC]": datetime,
}


def write_items(path: Path | str, rows: Sequence[Mapping[str, object]], crs: CRS | str) -> None:
    """Write the catalogue as GeoParquet, ordered by id, atomically.

    Parameters
    ----------
    rows : mappings with ROW_KEYS; `geometry` of a facade is a LineString in `crs`, `updated` is an aware datetime,
        None is unknown. A foot line with a non-finite coordinate becomes unknown.
    crs : any user input of pyproj.

    Raises
    ------
    InputError : names the facade and column of an unknown or missing key, a wrong type, or a duplicate id.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = Path(path)
    for row in rows:
        _check_row(row, path)
    rows = sorted(rows, key=lambda row: (ITEM_KINDS.index(str(row["kind"])), natural_sort_key(str(row["id"]))))
    for one, two in zip(rows, rows[1:], strict=False):
        if one["kind"] == two["kind"] == "facade" and one["id"] == two["id"]:
            raise InputError(f"{path.name}: facade {one['id']} has two rows; give each facade one")
    values = _column_values(rows, crs)
    arrays = [_arrow_array(column, values[column.name], rows, path) for column in COLUMNS]
    table = pa.Table.from_arrays(arrays, schema=_schema(values))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        pq.write_table(table, temporary, compression="zstd")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _check_row(row: Mapping[str, object], path: Path) -> None:
    facade = f"{path.name}: facade {row.get('id')}"
    if unknown := sorted(row.keys() - set(ROW_KEYS)):
        raise InputError(
            f"{facade}: no such column {unknown[0]}; add it to catalogs.published.items.COLUMNS or leave it out"
        )
    if missing := [key for key in ROW_KEYS if key not in row]:
        raise InputError(f"{facade}: column {missing[0]} is missing; give None where it is unknown")
    if empty := [column.name for column in COLUMNS if column.required and row.get(column.name, 0) is None]:
        raise InputError(f"{facade}: column {empty[0]} is None; it needs a value in every row")
    if row["kind"] not in ITEM_KINDS:
        raise InputError(f"{facade}: kind is {row['kind']!r}; give one of {', '.join(ITEM_KINDS)}")
    if row["kind"] != "facade":
        if row["geometry"] is not None or row["status"] != "failed" or not row["reason"]:
            raise InputError(f"{facade}: a {row['kind']} has a row only when it is set aside, with a reason")
        return
    geometry = row["geometry"]
    if getattr(geometry, "geom_type", None) != "LineString" or getattr(geometry, "is_empty", True):
        raise InputError(f"{facade}: geometry is no LineString; give the facade's foot line")
    if row["status"] not in STATUSES:
        raise InputError(f"{facade}: status is {row['status']!r}; give {' or '.join(STATUSES)}")
    if row["status"] == "failed" and not row["reason"]:
        raise InputError(f"{facade}: failed without a reason; say why")


def transform_foot_lines(foot_lines: Sequence[LineString | None], crs: CRS | str, target: CRS | str) -> ObjectArray:
    """Transform foot lines from one CRS to another, without heights.

    Parameters
    ----------
    foot_lines : (N,) lines in `crs`.

    Returns
    -------
    (N,) lines in `target`; None where a coordinate is not finite.
    """
    import shapely
    from pyproj import Transformer

    stated = np.empty(len(foot_lines), dtype=object)
    stated[:] = foot_lines
    flat = shapely.force_2d(stated)
    lines: ObjectArray = shapely.transform(
        flat, Transformer.from_crs(crs, target, always_xy=True).transform, interleaved=False
    )
    ends, line = shapely.get_coordinates(lines, return_index=True)
    lines[line[~np.isfinite(ends).all(axis=1)]] = None
    return lines


def _column_values(rows: Sequence[Mapping[str, object]], crs: CRS | str) -> dict[str, Sequence[object]]:
    import shapely

    feet = transform_foot_lines([row["geometry"] for row in rows], crs, LONLAT)
    values: dict[str, Sequence[object]] = {key: [row[key] for row in rows] for key in ROW_KEYS}
    values["geometry"] = [None if foot is None else shapely.to_wkb(foot) for foot in feet]
    return values | dict(zip(BBOX, shapely.bounds(feet).reshape(-1, 4).T.tolist(), strict=True))


def _arrow_array(
    column: ItemColumn, values: Sequence[object], rows: Sequence[Mapping[str, object]], path: Path
) -> pa.Array:
    import pyarrow as pa

    values = [None if value is None or value != value else value for value in values]  # NaN is unknown too
    for row, value in zip(rows, values, strict=True):
        # Arrow would truncate 3.5 to 3, and treat a time without a zone as UTC
        if value is not None and (
            not isinstance(value, _PYTHON_TYPES[column.type]) or (isinstance(value, datetime) and not value.tzinfo)
        ):
            raise InputError(f"{path.name}: facade {row['id']}: {column.name} is {value!r}; give {column.type}")
    return pa.array(values, arrow_type(column))


def arrow_type(column: ItemColumn) -> pa.DataType:
    """Return the Arrow type of a column."""
    import pyarrow as pa

    return pa.timestamp("us", "UTC") if column.type.startswith("timestamp") else pa.type_for_alias(column.type)


def _schema(values: Mapping[str, Sequence[object]]) -> pa.Schema:
    """Return the Arrow schema with the GeoParquet 1.1 header (no crs means OGC:CRS84)."""
    import pyarrow as pa

    geometry: JsonObject = {"encoding": "WKB", "geometry_types": ["LineString"]}
    found = {name: [value for value in values[name] if isinstance(value, float) and value == value] for name in BBOX}
    if found["xmin"]:
        ends = zip(BBOX, (min, min, max, max), strict=True)
        geometry["bbox"] = [extreme(found[name]) for name, extreme in ends]
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": geometry}}
    fields = [
        pa.field(
            column.name,
            arrow_type(column),
            nullable=not column.required,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in COLUMNS
    ]
    return pa.schema(fields, metadata={"geo": json.dumps(geo)})
