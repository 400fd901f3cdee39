"""File of a part of a city: a run of the part reads it instead of the city's files.

Values round-trip exactly, so a block has the same digest either way. Geometries are WKB, arrays are raw bytes, paths
are relative to the file; only classes listed in `serial_schemas` are constructed.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import shapely

from catalogs.block.serial_schemas import SCHEMAS
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonValue

# Class by its tag in a part file.
_CLASSES = {schema.tag: cls for cls, schema in SCHEMAS.items()}
EXTRACT_FORMAT = 2


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


def read_city_part_file(path: Path) -> dict[str, object]:
    """Read the file of a part of a city.

    Raises
    ------
    InputError : one line with the remedy, if the file is missing, damaged or of another format.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            text, blob = arrays["text"].tobytes(), arrays["blob"].tobytes()
        document = json.loads(text.decode(errors="surrogatepass"))
        if document["format"] != EXTRACT_FORMAT:
            raise ValueError(f"format {document['format']}")
        values = _decode_value(document["values"], blob, path.parent)
        if not isinstance(values, dict):
            raise ValueError("no named values")
        return values
    except FileNotFoundError:
        raise InputError(f"{path} is missing; `streetloom city` writes it") from None
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        zipfile.BadZipFile,
        zlib.error,
        shapely.GEOSException,
    ) as e:
        why = " ".join(str(e).split())[:100]
        raise InputError(f"{path} holds no part of a city that can be read ({why}); remove it, and `streetloom city` "
                         "writes it again") from e  # fmt: skip


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
        return {schema.tag: [_encode_value(getattr(value, attribute), blob, folder) for _, attribute in schema.fields]}
    if isinstance(value, Mapping):
        return {"map": [[name, _encode_value(part, blob, folder)] for name, part in value.items()]}
    if isinstance(value, list | tuple):
        return [_encode_value(part, blob, folder) for part in value]
    raise TypeError(f"no part of a city holds a {type(value).__name__}")


def _decode_value(encoded: JsonValue, blob: bytes, folder: Path) -> object:
    if isinstance(encoded, list):
        return tuple(_decode_value(part, blob, folder) for part in encoded)
    if not isinstance(encoded, dict):
        return encoded
    ((kind, content),) = encoded.items()
    if kind == "path":
        return Path(os.path.abspath(folder / content))
    if kind == "shape":
        return shapely.from_wkb(blob[content[0] : content[0] + content[1]])
    if kind == "array":
        dtype, shape, start = np.dtype(content[0]), tuple(content[1]), content[2]
        if dtype.hasobject:
            raise ValueError("an array of objects")
        return np.frombuffer(blob, dtype, int(np.prod(shape, dtype=np.int64)), start).reshape(shape).copy()
    if kind == "map":
        return {name: _decode_value(part, blob, folder) for name, part in content}
    cls = _CLASSES[kind]
    attributes = [attribute for _, attribute in SCHEMAS[cls].fields]
    if len(content) > len(attributes):
        raise ValueError(f"{kind} has {len(content)} values")
    # fields with defaults, which older files lack, are the last ones
    return cls(**dict(zip(attributes, (_decode_value(part, blob, folder) for part in content), strict=False)))


def _byte_array(blob: bytearray) -> UInt8Array:
    return np.frombuffer(bytes(blob), np.uint8)
