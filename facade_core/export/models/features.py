"""What a model answers of its parts: rows of a table as EXT_structural_metadata has them, one table for all of a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

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
    """A column: type string, int32 or double; unit, empty where it has none; meaning, a sentence."""

    name: str
    type: str
    unit: str
    description: str

    def schema(self) -> dict[str, Any]:
        meaning = f"{self.description} ({self.unit})" if self.unit else self.description
        types: dict[str, dict[str, Any]] = {
            "string": {"type": "STRING", "noData": NO_TEXT},
            "int32": {"type": "SCALAR", "componentType": "INT32", "noData": NO_INTEGER},
            "double": {"type": "SCALAR", "componentType": "FLOAT64", "noData": NO_NUMBER},
        }
        unit = {"extras": {"unit": self.unit}} if self.unit else {}
        return {"name": self.name, "description": meaning, **types[self.type], **unit}

    def table_property(self, rows: Sequence[Mapping[str, Any]], add_view: AddView) -> dict[str, Any] | None:
        """The column of some rows as a table's property; None where no row has a value."""
        found = [row.get(self.name) for row in rows]
        if all(value is None for value in found):
            return None
        if self.type == "string":
            texts = [(NO_TEXT if value is None else str(value)).encode() for value in found]
            offsets = np.concatenate([[0], np.cumsum([len(text) for text in texts])]).astype("<u4")
            return {
                # a view may not be empty, and texts that are all empty are no value
                "values": add_view(b"".join(texts) or b"\0"),
                "stringOffsets": add_view(offsets.tobytes()),
                "stringOffsetType": "UINT32",
            }
        none, kind = (NO_INTEGER, "<i4") if self.type == "int32" else (NO_NUMBER, "<f8")
        return {"values": add_view(np.array([none if value is None else value for value in found], kind).tobytes())}


@dataclass(frozen=True)
class FeatureTable:
    """The parts of a block: rows, by the properties' names; of_chart (charts,), the row of each chart; of_owner (charts,), that
    of its building, of a piece of ground its own."""

    properties: tuple[MetadataProperty, ...]
    rows: Sequence[Mapping[str, Any]]
    chart_rows: np.ndarray
    owner_rows: np.ndarray

    def select_building_rows(self, building: np.ndarray, charts_building: np.ndarray) -> np.ndarray:
        """The rows (k,) of buildings (k,); charts_building (charts,): whose charts these features are of."""
        first = np.full(int(charts_building.max(initial=-1)) + 1, -1, np.int64)
        built = charts_building >= 0
        first[charts_building[built]] = self.owner_rows[built]
        return first[building]

    def structural_metadata(self, rows: np.ndarray, add_view: AddView) -> dict[str, Any]:
        """EXT_structural_metadata of some rows (k,)."""
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


def add_feature_ids(ids: np.ndarray, rows: int, buffer: GlbBuffer) -> tuple[dict[str, int], dict[str, Any]]:
    """The attributes of a primitive's vertices that name their rows, and EXT_mesh_features of it, a set for each label.

    ids (v, labels), of a table of so many rows. All sets are of the one table, but only the first says so: CesiumJS takes a
    table for one set alone."""
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
