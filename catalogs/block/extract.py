"""File of a part of a city: a run of the part reads it instead of the city's files.

Values round-trip exactly, so a block has the same digest either way. Geometries are WKB, arrays are raw bytes, paths
are relative to the file; only classes of `value_encoding` are constructed.
"""

from __future__ import annotations

import io
import json
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
from catalogs.block.value_encoding import ValueDecoder, ValueEncoder
from catalogs.block.value_types import require_attribute_types
from catalogs.buildings.extents import Bounds
from catalogs.features import Fault
from catalogs.reader_errors import short_message
from catalogs.readers.json_text import parse_json_object
from catalogs.readers.meshes.npz import check_npz_arrays
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.errors import InputError
from facade_core.core.regular_files import MAX_TEXT_BYTES, require_regular
from facade_core.core.types import Building, MappedGround, Street

# A change to the fields of a class in `VALUE_TYPES` is another format.
EXTRACT_FORMAT = 4


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
    """Attributes of a block that the file of a part of a city holds."""

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
    geoid_separation: float | None
    part: CityPart | None


def write_city_part_file(path: Path, values: Mapping[str, object]) -> None:
    """Write the file of a part of a city atomically; an identical file is not rewritten."""
    encoder = ValueEncoder(path.parent)
    text = json.dumps({"format": EXTRACT_FORMAT, "values": encoder.encode(dict(values))}, ensure_ascii=False)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        text=np.frombuffer(text.encode(errors="surrogatepass"), np.uint8),
        blob=np.frombuffer(bytes(encoder.blob), np.uint8),
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
        contents = {name: values[name] for name in PartContents.__annotations__}
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
        values = ValueDecoder(blob, path.parent).decode(document["values"])
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
    return f"{path} holds no part of a city that can be read ({why}); `streetloom city` writes it again"
