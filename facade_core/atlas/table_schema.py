"""Declaration of the tables of a block's plan.

Writing, reading and opening the tables follows from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from facade_core.core.arrays import AnyArray
from facade_core.core.errors import StoreError
from facade_core.geometry.charts import CHART_KINDS
from facade_core.geometry.walls import WALL_ROLES

if TYPE_CHECKING:
    import xarray as xr

TEXT = "text"
# Columns and attributes of a table by name; their types are those that TABLES declares.
TableValues = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """Column of a table.

    Attributes
    ----------
    name : name of the array.
    dims : dimensions, the rows first.
    dtype : numpy dtype, `TEXT` for strings.
    attributes : CF attributes.
    is_position : values are positions in the block's CRS.
    is_optional : the column may be missing.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    attributes: Mapping[str, object] = field(default_factory=dict)
    is_position: bool = False
    is_optional: bool = False


@dataclass(frozen=True)
class Table:
    """Group of the store whose arrays are columns.

    Attributes
    ----------
    name : name of the group.
    columns : columns of the table.
    attributes : names of the group's attributes besides `crs`.
    is_optional : the group may be missing.
    """

    name: str
    columns: tuple[Column, ...]
    attributes: tuple[str, ...] = ()
    is_optional: bool = False

    def to_dataset(self, values: Mapping[str, object], attributes: Mapping[str, object], crs: str) -> xr.Dataset:
        """Convert column values to the Dataset that is written.

        Raises
        ------
        StoreError
            Columns or attributes differ from the declared ones.
        """
        import xarray as xr

        declared = {column.name for column in self.columns}
        needed = {column.name for column in self.columns if not column.is_optional}
        if not needed <= set(values) <= declared or set(attributes) != set(self.attributes):
            mismatch = (needed - set(values)) | (set(values) - declared) | (set(attributes) ^ set(self.attributes))
            raise StoreError(
                f"table {self.name}: {', '.join(sorted(mismatch))} missing or not declared in TABLES; declare it"
            )
        variables = {
            column.name: (column.dims, _to_array(values[column.name], column.dtype), dict(column.attributes))
            for column in self.columns
            if column.name in values
        }
        return xr.Dataset(variables, attrs={**attributes, "crs": crs})

    def read_columns(self, dataset: xr.Dataset) -> TableValues:
        """Return the columns' values (rows, ...) and the table's attributes by name.

        Strings are returned as str.

        Raises
        ------
        KeyError
            A required column or attribute is missing.
        """
        values: dict[str, object] = {name: dataset.attrs[name] for name in self.attributes}
        for column in self.columns:
            if not column.is_optional or column.name in dataset:
                column_values = dataset[column.name].values
                values[column.name] = tuple(map(str, column_values)) if column.dtype == TEXT else column_values
        return values


def _to_array(values: object, dtype: str) -> AnyArray:
    if dtype == TEXT:
        return text_column(cast(Sequence[str], values))
    return np.asarray(values, dtype)


def text_column(values: Sequence[str]) -> AnyArray:
    """Convert strings to a variable-length string column of zarr."""
    return np.array(list(values), dtype=np.dtypes.StringDType())


def _column(name: str, dims: str, dtype: str, long_name: str = "", units: str = "", **more: object) -> Column:
    """Declare a column.

    dims: names separated by blanks. more: `is_position`, `is_optional` and further CF attributes.
    """
    is_position, is_optional = (bool(more.pop(key, False)) for key in ("is_position", "is_optional"))
    cf_attributes = {key: value for key, value in (("units", units), ("long_name", long_name)) if value}
    return Column(name, tuple(dims.split()), dtype, {**cf_attributes, **more}, is_position, is_optional)


_KIND_FLAGS: dict[str, object] = {"flag_values": list(range(len(CHART_KINDS))), "flag_meanings": " ".join(CHART_KINDS)}

_ROLE_FLAGS: dict[str, object] = {"flag_values": list(range(len(WALL_ROLES))), "flag_meanings": " ".join(WALL_ROLES)}

TABLES = {
    table.name: table
    for table in (
        Table(
            "charts",
            (
                _column(
                    "kind",
                    "chart",
                    "uint8",
                    ", ".join(f"{i} {kind}" for i, kind in enumerate(CHART_KINDS)),
                    "",
                    **_KIND_FLAGS,
                ),
                _column("surface", "chart", "int32", "the uncut surface that the chart is a piece of"),
                _column("building", "chart", "int32", "row of buildings, -1 for ground"),
                _column("origin", "chart xyz", "float64", "upper left corner", "m", is_position=True),
                _column("axis_u", "chart xyz", "float64", "unit vector to the right", "1"),
                _column("axis_v", "chart xyz", "float64", "unit vector down", "1"),
                _column("size", "chart width_height", "float64", "extent along the axes", "m"),
                _column("page", "chart", "int32", "page of the atlas"),
                _column("x", "chart", "int32", "first column on the page", "texel"),
                _column("y", "chart", "int32", "first row on the page", "texel"),
                _column("width", "chart", "int32", "columns", "texel"),
                _column("height", "chart", "int32", "rows", "texel"),
                _column("texels_per_metre", "chart", "float64", "texels per metre", "m-1", is_optional=True),
                _column("writable", "chart", "bool", "written by no facade and no texture of the source"),
                _column("textured", "chart", "bool", "with a texture of the source's own, or from above"),
                _column("own", "chart", "bool", "textured and published, not only seen", is_optional=True),
                _column("id", "chart", "uint64", "digest of the chart's kind, place and building"),
                _column(
                    "street_texels_per_metre",
                    "chart",
                    "float64",
                    "texels per metre before pictures raise them",
                    "m-1",
                    is_optional=True,
                ),
            ),
            ("page_size", "chunk", "gutter"),
        ),
        Table(
            "mesh",
            (
                _column(
                    "vertices",
                    "vertex xyz",
                    "float64",
                    "corners of triangles, of one chart each",
                    "m",
                    is_position=True,
                ),
                _column("triangles", "triangle corner", "int32", "rows of vertices, counter-clockwise from outside"),
                _column("triangle_chart", "triangle", "int32", "row of charts"),
                _column("vertex_chart", "vertex", "int32", "row of charts"),
                _column("texture", "triangle", "int32", "picture of the source, -1 none", is_optional=True),
                _column(
                    "uv", "triangle corner uv", "float32", "place in the picture, right and up", "1", is_optional=True
                ),
            ),
        ),
        Table(
            "sightings",
            (
                _column("facade", "sighting", "int32", "row of facades"),
                _column("panorama", "sighting", "int32", "row of poses"),
                _column("seen", "sighting", "float64", "share of the facade that it shows", "1"),
                _column("pixels_per_metre", "sighting", "float64", "resolution of the panorama on it", "m-1"),
            ),
        ),
        Table(
            "poses",
            (
                _column("position", "panorama xyz", "float64", "where it was taken", "m", is_position=True),
                _column(
                    "angles",
                    "panorama heading_pitch_roll",
                    "float64",
                    "heading clockwise from grid north, pitch up, roll clockwise",
                    "degree",
                ),
                _column(
                    "view",
                    "panorama left_top_width_height",
                    "float64",
                    "part of the full sphere that the picture holds",
                    "1",
                ),
                _column(
                    "lens",
                    "panorama lens_value",
                    "float64",
                    "lens of a perspective picture in pixels: size, focal lengths, centre, skew, fisheye, distortion",
                    "",
                    is_optional=True,
                ),
            ),
        ),
        Table(
            "facades",
            (
                _column("id", "facade", TEXT, "building and number of the wall"),
                _column("chart", "facade", "int32", "row of charts"),
                _column("street", "facade", "int32", "row of streets, that which sees it best, or the nearest"),
                _column("building", "facade", "int32", "row of buildings"),
                _column("role", "facade", "uint8", "what it is to the streets", "", **_ROLE_FLAGS),
                _column("width", "facade", "float64", "along the wall", "m"),
                _column("height", "facade", "float64", "of the wall", "m"),
                _column("floors", "facade", "int32", "storeys by the map", "1"),
                _column("seen", "facade", "float64", "share seen from its street", "1"),
                _column("run", "facade", "int32", "row of the first facade that is laid out as one with it"),
                _column("along", "facade", "float64", "from where that begins", "m"),
                _column("foot", "facade", "float64", "over the foot of most walls of its building", "m"),
                _column("eaves", "facade", "float64", "from there to where most of these walls end", "m"),
                _column("storeys", "facade", "int32", "storeys from there to there", "1"),
                _column("raised", "facade", "bool", "whether its building begins above the ground", is_optional=True),
                _column(
                    "house",
                    "facade",
                    "int64",
                    "number of the building, or of that of which it is a part",
                    is_optional=True,
                ),
                _column(
                    "roofed", "facade", "bool", "whether the model has a roof of its own above it", is_optional=True
                ),
            ),
        ),
        Table(
            "viewpoints",
            (
                _column("street", "viewpoint", "int32", "row of streets"),
                _column("position", "viewpoint xyz", "float64", "centre of the panorama", "m", is_position=True),
                _column("forward", "viewpoint xy", "float64", "unit vector along the street", "1"),
                _column("look", "viewpoint", TEXT, "digest of the geometry in sight"),
                _column("view_viewpoint", "view", "int32", "row of viewpoints, of each chart that one shows"),
                _column("view_chart", "view", "int32", "row of charts, of each that a viewpoint shows"),
            ),
            ("spacing", "visibility_range"),
        ),
        Table(
            "streets",
            (
                _column("id", "street", TEXT, "name in the source"),
                _column("name", "street", TEXT, "name, empty where it has none"),
                _column("point", "vertex xy", "float64", "centreline", "m", is_position=True),
                _column("point_street", "vertex", "int64", "row of streets"),
            ),
        ),
        Table(
            "ways",
            (
                _column("id", "way", TEXT, "name in the source"),
                _column("kind", "way", TEXT, "road, path, cycle, steps, tram or crossing"),
                _column("line", "way", TEXT, "well-known binary in hexadecimal, in the block's CRS"),
                _column("width", "way", "float64", "from edge to edge, of tracks their gauge", "m"),
                _column("assumed", "way", "bool", "whether the width is by class or by what buildings leave"),
                _column("surface", "way", TEXT, "what it is made of"),
                _column("lanes", "way", "int32", "marked lanes, 0 where none are", "1"),
                _column("oneway", "way", "bool", "driven in one direction"),
                _column("pavement", "way left_right", "float64", "pavement beside it, 0 where there is none", "m"),
                _column("parking", "way left_right", "float64", "parked cars on it, 0 where there are none", "m"),
                _column("rank", "way", "int32", "whose surface goes through where roads meet, the larger", "1"),
            ),
        ),
        Table(
            "areas",
            (
                _column("id", "area", TEXT, "name in the source"),
                _column("outline", "area", TEXT, "well-known binary in hexadecimal, in the block's CRS"),
                _column("surface", "area", TEXT, "what it is made of"),
            ),
            ("block",),
        ),
        Table(
            "objects",
            (
                _column("id", "object", TEXT, "name in the source, with a number along a line"),
                _column("kind", "object", TEXT, "kind, such as tree or bench"),
                _column("variant", "object", "int32", "variant of the model of the kind"),
                _column("position", "object xyz", "float64", "middle of the foot", "m", is_position=True),
                _column("heading", "object", "float64", "of the front, clockwise from grid north", "degree"),
                _column("size", "object along_deep_high", "float64", "along the front, deep and high", "m"),
                _column("is_stated", "object", "bool", "False where no map states it", is_optional=True),
            ),
            is_optional=True,
        ),
        Table(
            "surroundings",
            (
                _column("vertices", "vertex xyz", "float64", "corners around the block", "m", is_position=True),
                _column("normal", "vertex xyz", "float64", "outward unit vector", "1"),
                _column("material", "vertex", "uint8", "surface of the ground, 7 wall, 8 roof"),
                _column("tint", "vertex rgb", "uint8", "stated colour, zeros where none is"),
                _column("seed", "vertex", "int64", "number of the building"),
                _column("triangles", "triangle corner", "int32", "rows of vertices, counter-clockwise from outside"),
            ),
            is_optional=True,
        ),
        Table(
            "buildings",
            (
                _column("id", "building", TEXT, "name in the source"),
                _column("name", "building", TEXT, "name, empty where it has none"),
                _column("height", "building", "float64", "from the ground to the eaves, of a model to its top", "m"),
                _column("height_source", "building", TEXT, "what the height was taken from"),
                _column("levels", "building", "int32", "storeys as tagged, 0 where they are not", "1"),
                _column("raised", "building", "float64", "from the ground to where it begins", "m", is_optional=True),
                _column("part_of", "building", TEXT, "id of the whole, empty of a whole one", is_optional=True),
                _column("roof_shape", "building", TEXT, "as in OpenStreetMap, empty of a model", is_optional=True),
                _column("roof_height", "building", "float64", "from the eaves to the ridge", "m", is_optional=True),
                _column(
                    "roof_confidence",
                    "building",
                    "float64",
                    "1 where stated, less where assumed",
                    "1",
                    is_optional=True,
                ),
                _column("wall_colour", "building", TEXT, "as stated, #rrggbb, empty where it is not", is_optional=True),
                _column("roof_colour", "building", TEXT, "as stated, #rrggbb, empty where it is not", is_optional=True),
                _column("wall_material", "building", TEXT, "as stated, by OpenStreetMap's values", is_optional=True),
                _column("roof_material", "building", TEXT, "as stated, by OpenStreetMap's values", is_optional=True),
                _column("refused", "building", TEXT, "why it has no surfaces, empty where it has"),
            ),
        ),
    )
}
