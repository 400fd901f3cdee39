"""File of a part of a city: a run of the part reads it instead of the city's files.

Values round-trip exactly, so a block has the same digest either way. Geometries are WKB, arrays are raw bytes, paths
are relative to the file; only classes listed in `serial_schemas` are constructed.
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict, cast

import numpy as np
import shapely

from catalogs.block.part import CityPart
from catalogs.block.serial_schemas import PART_FIELDS, SCHEMAS
from catalogs.block.value_types import require_attribute_types
from catalogs.buildings.extents import Bounds
from catalogs.features import Fault
from catalogs.reader_errors import short_message
from catalogs.readers.json_text import parse_json_object
from catalogs.readers.meshes.npz import check_npz_arrays
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonValue
from facade_core.core.regular_files import MAX_TEXT_BYTES, require_regular
from facade_core.core.types import Building, BuildingShell, MappedGround, Street

# Class by its tag in a part file.
_CLASSES = {schema.tag: cls for cls, schema in SCHEMAS.items()}
EXTRACT_FORMAT = 2


@dataclass(frozen=True)
class CityPartFile:
    """Content of the file of a part of a city.

    Attributes
    ----------
    crs : frame of the city.
    extent : (xmin, ymin, xmax, ymax) of the city's buildings with a margin, metres.
    contents : attributes of the block by name.
    """

    crs: str
    extent: Bounds
    contents: PartContents


class PartContents(TypedDict):
    """Attributes of a block that the file of a part of a city holds (`PART_FIELDS`)."""

    buildings: tuple[Building, ...]
    streets: tuple[Street, ...]
    entrances: tuple[tuple[float, float], ...]
    ground: MappedGround
    exemplars: tuple[Path, ...]
    photos: dict[str, Path]
    panoramas: tuple[PosedPanorama, ...]
    textures: tuple[Path, ...]
    aerial: Orthophoto | None
    faults: tuple[Fault, ...]
    part: CityPart | None


def write_city_part_file(path: Path, values: Mapping[str, object]) -> None:
    """Write the file of a part of a city atomically; an identical file is not rewritten."""
    blob = bytearray()
    text = json.dumps(
        {"format": EXTRACT_FORMAT, "values": _encode_value(dict(values), blob, path.parent)}, ensure_ascii=False
    )
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, text=np.frombuffer(text.encode(errors="surrogatepass"), np.uint8), blob=_byte_array(blob)
    )
    if path.is_file() and path.read_bytes() == buffer.getvalue():
        return
    temporary = path.with_name(f".{path.name}.tmp")
    temporary.write_bytes(buffer.getvalue())
    os.replace(temporary, path)


def read_city_part(path: Path) -> CityPartFile:
    """Read the file of a part of a city, and check that every value has its type.

    Raises
    ------
    InputError : as `read_city_part_file`, or a value is missing or of another type.
    """
    values = read_city_part_file(path)
    try:
        crs, extent = values["crs"], values["extent"]
        contents = {attribute: values[name] for name, attribute in PART_FIELDS}
        require_attribute_types(PartContents, contents)
        require_attribute_types(CityPartFile, {"crs": crs, "extent": extent})
    except (KeyError, TypeError) as error:
        raise InputError(_unreadable_message(path, error)) from error
    return CityPartFile(cast(str, crs), cast(Bounds, extent), cast(PartContents, contents))


def read_city_part_file(path: Path) -> dict[str, object]:
    """Read the values of the file of a part of a city.

    Raises
    ------
    InputError : one line with the remedy, if the file is missing, damaged or of another format.
    """
    try:
        require_regular(path)
        check_npz_arrays(path, ("text", "blob"))
        with np.load(path, allow_pickle=False) as arrays:
            text, blob = arrays["text"].tobytes(), arrays["blob"].tobytes()
        if len(text) > MAX_TEXT_BYTES:
            raise ValueError(f"its text unpacks to over {MAX_TEXT_BYTES // 2**20} MB")
        document = parse_json_object(text, "its text")
        if document["format"] != EXTRACT_FORMAT:
            raise ValueError(f"format {document['format']}")
        values = _Decoder(blob, path.parent).decode(document["values"])
        if not isinstance(values, dict):
            raise ValueError("no named values")
        return values
    except FileNotFoundError:
        raise InputError(f"{path} is missing; `streetloom city` writes it") from None
    except (
        InputError,
        OSError,
        ValueError,
        KeyError,
        TypeError,
        IndexError,
        AttributeError,
        OverflowError,
        RecursionError,
        EOFError,
        zipfile.BadZipFile,
        zlib.error,
        shapely.GEOSException,
    ) as error:
        raise InputError(_unreadable_message(path, error)) from error


def _unreadable_message(path: Path, error: Exception) -> str:
    why = short_message(error).removeprefix(str(path)).lstrip(": ")
    return f"{path} holds no part of a city that can be read ({why}); remove it, and `streetloom city` writes it again"


def _encode_value(value: object, blob: bytearray, folder: Path) -> JsonValue:
    """Encode a value as JSON; binary data are appended to `blob`."""
    value = value.item() if isinstance(value, np.generic) else value
    if value is None or isinstance(value, bool | str | int | float):
        return value
    if isinstance(value, Path):
        return {"path": os.path.relpath(value, folder)}
    if isinstance(value, shapely.Geometry):
        octets = shapely.to_wkb(value)
        blob += octets
        return {"shape": [len(blob) - len(octets), len(octets)]}
    if isinstance(value, np.ndarray):
        blob += np.ascontiguousarray(value).tobytes()
        return {"array": [value.dtype.str, list(value.shape), len(blob) - value.nbytes]}
    if (schema := SCHEMAS.get(type(value))) is not None:
        return {
            schema.tag: [
                _encode_value(getattr(value, attribute), blob, folder) for _, attribute in schema.stated_fields(value)
            ]
        }
    if isinstance(value, Mapping):
        return {"map": [[name, _encode_value(part, blob, folder)] for name, part in value.items()]}
    if isinstance(value, list | tuple):
        return [_encode_value(part, blob, folder) for part in value]
    raise TypeError(f"no part of a city holds a {type(value).__name__}")


class _Decoder:
    """Decoder of the values of a part, which together take no more of the binary data than there is."""

    def __init__(self, blob: bytes, folder: Path) -> None:
        self._blob, self._folder, self._left = blob, folder, len(blob)

    def decode(self, encoded: JsonValue) -> object:
        if isinstance(encoded, list):
            return tuple(self.decode(part) for part in encoded)
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
        cls = _CLASSES[kind]
        attributes = [attribute for _, attribute in SCHEMAS[cls].fields]
        if len(content) > len(attributes):
            raise ValueError(f"{kind} has {len(content)} values")
        # fields with defaults, which older files lack, are the last ones
        values = dict(zip(attributes, map(self.decode, content), strict=False))
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


def _byte_array(blob: bytearray) -> UInt8Array:
    return np.frombuffer(bytes(blob), np.uint8)
