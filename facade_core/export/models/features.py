"""Feature table of a model: one row per part, as EXT_structural_metadata and EXT_mesh_features."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Int64Array, IntArray
from facade_core.export.models.buffers import FLOAT, UNSIGNED_SHORT, GlbBuffer

# noData value of strings; no column contains it.
NO_TEXT = ""
# noData value of integers; no column contains it.
NO_INTEGER = -(2**31)
# noData value of floating-point numbers; no column contains it.
NO_NUMBER = -9999.0
METADATA_CLASS = "part"
# Labels of the id sets of a vertex: the row of its part and of its building.
FEATURE_ID_LABELS = ("part", "building")
# Appends data to the buffer of a model and returns the index of its view.
AddView = Callable[[bytes], int]


@dataclass(frozen=True, slots=True)
class MetadataProperty:
    """Column of the feature table.

    Attributes
    ----------
    name : name of the column.
    type : "string", "int32" or "double".
    unit : unit of the values; empty where there is none.
    description : meaning of the column, one sentence.
    """

    name: str
    type: str
    unit: str
    description: str

    def schema(self) -> dict[str, object]:
        """Return the schema of the column as a property of a metadata class."""
        meaning = f"{self.description} ({self.unit})" if self.unit else self.description
        types: dict[str, dict[str, object]] = {
            "string": {"type": "STRING", "noData": NO_TEXT},
            "int32": {"type": "SCALAR", "componentType": "INT32", "noData": NO_INTEGER},
            "double": {"type": "SCALAR", "componentType": "FLOAT64", "noData": NO_NUMBER},
        }
        unit = {"extras": {"unit": self.unit}} if self.unit else {}
        return {"name": self.name, "description": meaning, **types[self.type], **unit}

    def table_property(self, rows: Sequence[Mapping[str, object]], add_view: AddView) -> dict[str, object] | None:
        """Return the column of some rows as a property of a property table; None if no row has a value."""
        found = [row.get(self.name) for row in rows]
        if all(value is None for value in found):
            return None
        if self.type == "string":
            return _text_property([NO_TEXT if value is None else str(value) for value in found], add_view)
        none, kind = (NO_INTEGER, "<i4") if self.type == "int32" else (NO_NUMBER, "<f8")
        return {"values": add_view(np.array([none if value is None else value for value in found], kind).tobytes())}


def _text_property(values: Sequence[str], add_view: AddView) -> dict[str, object]:
    texts = [value.encode() for value in values]
    offsets = np.concatenate([[0], np.cumsum([len(text) for text in texts])]).astype("<u4")
    return {
        # a view must not be empty
        "values": add_view(b"".join(texts) or b"\0"),
        "stringOffsets": add_view(offsets.tobytes()),
        "stringOffsetType": "UINT32",
    }


@dataclass(frozen=True)
class FeatureTable:
    """Feature rows of a block and the rows that its charts belong to.

    Attributes
    ----------
    properties : columns of the table.
    rows : values of every row by column name.
    chart_rows : (charts,) row of each chart.
    owner_rows : (charts,) row of the building of each chart; ground charts have their own row.
    """

    properties: tuple[MetadataProperty, ...]
    rows: Sequence[Mapping[str, object]]
    chart_rows: IntArray
    owner_rows: IntArray

    def select_building_rows(self, building: IntArray, charts_building: IntArray) -> Int64Array:
        """Return the rows of some buildings.

        Parameters
        ----------
        building : (k,) building indices.
        charts_building : (charts,) building of each chart of the block, -1 for ground.

        Returns
        -------
        (k,) rows.
        """
        first = np.full(int(charts_building.max(initial=-1)) + 1, -1, np.int64)
        built = charts_building >= 0
        first[charts_building[built]] = self.owner_rows[built]
        return first[building]

    def structural_metadata(self, rows: IntArray, add_view: AddView) -> dict[str, object]:
        """Return EXT_structural_metadata with the given rows.

        Parameters
        ----------
        rows : (k,) rows of the table.
        add_view : appends data to the model's buffer and returns the index of its view.
        """
        shown = [self.rows[row] for row in rows.tolist()]
        columns = {
            one.name: found for one in self.properties if (found := one.table_property(shown, add_view)) is not None
        }
        schema = {
            "id": "streetloom",
            "description": "parts of a textured block, by the columns of its catalogue",
            "classes": {
                METADATA_CLASS: {
                    "name": METADATA_CLASS,
                    "properties": {one.name: one.schema() for one in self.properties},
                }
            },
        }
        table = {"name": "parts", "class": METADATA_CLASS, "count": len(shown), "properties": columns}
        return {"schema": schema, "propertyTables": [table]}


def add_feature_ids(ids: IntArray, rows: int, buffer: GlbBuffer) -> tuple[dict[str, int], dict[str, object]]:
    """Add feature ids to a primitive: one id set per label.

    All sets refer to the same table, but only the first says so, because CesiumJS accepts a table for one set only.

    Parameters
    ----------
    ids : (v, labels) row of every vertex per label.
    rows : number of rows of the table.
    buffer : buffer of the model; changed in place.

    Returns
    -------
    Attributes of the primitive, and its EXT_mesh_features.
    """
    kind, component = ("<u2", UNSIGNED_SHORT) if rows <= np.iinfo("<u2").max else ("<f4", FLOAT)
    attributes = {
        f"_FEATURE_ID_{number}": buffer.add_accessor(ids[:, number : number + 1].astype(kind), component, "SCALAR")
        for number in range(len(FEATURE_ID_LABELS))
    }
    sets = [
        {
            "featureCount": len(np.unique(ids[:, number])),
            "attribute": number,
            "label": label,
            **({} if number else {"propertyTable": 0}),
        }
        for number, label in enumerate(FEATURE_ID_LABELS)
    ]
    return attributes, {"featureIds": sets}
