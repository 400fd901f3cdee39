"""The one description of how values of a block are serialised, for part files and digests.

A dataclass is its name and its fields. Geometries are WKB and arrays raw bytes, both in one block of binary data.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np
import shapely

from catalogs.block.part import CityPart
from catalogs.block.value_types import require_attribute_types
from catalogs.features import Fault
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.json_types import JsonValue
from facade_core.core.types import (
    Building,
    BuildingFinish,
    BuildingPassage,
    BuildingShell,
    ElevationRaster,
    GroundArea,
    GroundObject,
    GroundWay,
    Lens,
    MappedGround,
    Pose,
    Roof,
    Street,
)

# The only classes that are encoded, and constructed from a file.
VALUE_TYPES: Mapping[str, type] = {
    cls.__name__: cls
    for cls in (
        Building, BuildingFinish, BuildingPassage, BuildingShell, CityPart, ElevationRaster, Fault, GroundArea, GroundObject,
        GroundWay, Lens, MappedGround, Orthophoto, Pose, PosedPanorama, Roof, Street,
    )
}  # fmt: skip


class ValueEncoder:
    """Encoder of values as JSON; binary data are appended to `blob`, and paths are relative to a folder."""

    def __init__(self, folder: Path) -> None:
        self.blob = bytearray()
        self._folder = folder

    def encode(self, value: object) -> JsonValue:
        """Encode a value with all that it contains. Raises TypeError for unknown types."""
        value = value.item() if isinstance(value, np.generic) else value
        if value is None or isinstance(value, bool | str):
            return value
        if isinstance(value, int | float):
            return self.encode_number(value)
        if isinstance(value, Path):
            return self.encode_path(value)
        if isinstance(value, shapely.Geometry):
            octets = shapely.to_wkb(value)
            self.blob += octets
            return {"shape": [len(self.blob) - len(octets), len(octets)]}
        if isinstance(value, np.ndarray):
            self.blob += np.ascontiguousarray(value).tobytes()
            return {"array": [value.dtype.str, list(value.shape), len(self.blob) - value.nbytes]}
        name = type(value).__name__
        if VALUE_TYPES.get(name) is type(value):
            return {name: [self.encode(getattr(value, field)) for field in _field_names(type(value))]}
        if isinstance(value, Mapping):
            return {"map": [[self.encode(key), self.encode(part)] for key, part in value.items()]}
        if isinstance(value, list | tuple):
            return [self.encode(part) for part in value]
        raise TypeError(f"no serial form of {name}")

    def encode_number(self, value: float) -> JsonValue:
        """Encode a number as itself."""
        return value

    def encode_path(self, path: Path) -> JsonValue:
        """Encode a path relative to the folder."""
        return {"path": os.path.relpath(path, self._folder)}


class DigestEncoder(ValueEncoder):
    """Encoder for digests: equal numbers are equal, integer or not, and a path is an error."""

    def __init__(self) -> None:
        super().__init__(Path())

    def encode_number(self, value: float) -> JsonValue:
        """Encode a number exactly, without -0."""
        is_exact = isinstance(value, float) or abs(value) < 2**53
        return (value + 0.0).hex() if is_exact else str(value)

    def encode_path(self, path: Path) -> JsonValue:
        """Refuse a path: its file's bytes or its name are to be encoded."""
        raise TypeError(f"no digest of the path {path.name}")

    def encode_bytes(self, value: object) -> bytes:
        """Return the bytes that a digest of a value is computed of."""
        return json.dumps(self.encode(value)).encode() + self.blob


class ValueDecoder:
    """Decoder of encoded values, which together take no more of the binary data than there is."""

    def __init__(self, blob: bytes, folder: Path) -> None:
        self._blob, self._folder, self._left = blob, folder, len(blob)

    def decode(self, encoded: JsonValue) -> object:
        """Decode a value. Raises ValueError, KeyError, TypeError or IndexError for what no encoder wrote."""
        if isinstance(encoded, list):
            return tuple(map(self.decode, encoded))
        if not isinstance(encoded, dict):
            return encoded
        ((kind, content),) = encoded.items()
        if kind == "path":
            return Path(os.path.abspath(self._folder / content))
        if kind == "shape":
            return shapely.from_wkb(self._take(*content))
        if kind == "array":
            dtype, shape, start = np.dtype(content[0]), tuple(content[1]), content[2]
            if dtype.kind not in "biuf":
                raise ValueError(f"an array of {dtype}")
            octets = self._take(start, math.prod(shape) * dtype.itemsize)
            return np.frombuffer(octets, dtype).reshape(shape).copy()
        if kind == "map":
            return {name: self.decode(part) for name, part in content}
        cls = VALUE_TYPES[kind]
        values = dict(zip(_field_names(cls), map(self.decode, content), strict=True))
        require_attribute_types(cls, values)
        if cls is BuildingShell:
            _check_shell(values)
        return cls(**values)

    def _take(self, start: int, count: int) -> bytes:
        """Return binary data; each part of them is stored once."""
        if start < 0 or count < 0 or start + count > len(self._blob) or count > self._left:
            raise ValueError("it states more binary data than it holds")
        self._left -= count
        return self._blob[start : start + count]


def _field_names(cls: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(cls))


def _check_shell(values: Mapping[str, object]) -> None:
    """Raise ValueError unless the arrays of a shell belong together."""
    vertices, triangles, semantic, texture, uv = (
        np.asarray(values[name]) for name in ("vertices", "triangles", "semantic", "texture", "uv")
    )
    count = len(triangles)
    shapes = (vertices.shape[1:], triangles.shape[1:], semantic.shape, texture.shape, uv.shape)
    fits = shapes == ((3,), (3,), (count,), (count,), (count, 3, 2))
    if not fits or (count and not 0 <= triangles.min() <= triangles.max() < len(vertices)):
        raise ValueError("a model's arrays do not belong together")
