"""Merge of GLB files of `encode_glb` into one; geometry and images are copied byte for byte."""

from __future__ import annotations

import json
import os
import shutil
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import merge_attribution_lines
from facade_core.export.models.glb import (
    BINARY_CHUNK,
    HEADER_BYTES,
    JSON_CHUNK,
    SAMPLERS,
    UNLIT_EXTENSIONS,
    read_glb_header,
)

# Lists of a document whose entries are referenced by index; references shift by the entries before.
INDEXED_LISTS = ("accessors", "bufferViews", "images", "materials", "meshes", "textures")


@dataclass(frozen=True)
class GlbFileHeader:
    """Header of a GLB file: its glTF document and the place of its binary data.

    Attributes
    ----------
    path : the file.
    document : its glTF document.
    start : offset of the binary data in the file, bytes.
    length : length of the binary data, bytes.
    """

    path: Path
    document: JsonObject
    start: int
    length: int


def read_glb_file_header(path: Path) -> GlbFileHeader:
    """Read the header of a GLB file.

    Raises
    ------
    ValueError : the file is not a GLB.
    """
    with path.open("rb") as file:
        document, start = read_glb_header(file)
        length = sum(buffer["byteLength"] for buffer in document.get("buffers", ()))
    return GlbFileHeader(path, document, start, length)


def merge_glbs(
    path: Path,
    parts: Sequence[GlbFileHeader],
    origin: Sequence[float],
    *,
    extras: Mapping[str, object],
    copyright: str = "",
) -> int:
    """Write several models as one GLB and return its size in bytes.

    Each part states its own `origin` in the extras of its scene; its nodes are translated from there. The file is replaced
    atomically, and binary data are streamed.

    Parameters
    ----------
    path : file to write.
    parts : models to merge.
    origin : (3,) origin of the new model, world metres.
    extras : extras of the new scene.
    copyright : attribution; those of the parts are added, each once.
    """
    document: JsonObject = {name: [] for name in (*INDEXED_LISTS, "nodes")}
    length = 0
    for part in parts:
        first = {name: len(document[name]) for name in INDEXED_LISTS}
        _append_document(document, part.document, first, length, origin)
        length += part.length
    nodes = list(range(len(document["nodes"])))
    scene: JsonObject = {**({"nodes": nodes} if nodes else {}), "extras": {"origin": list(origin), **extras}}
    asset = {"version": "2.0", "generator": "Streetloom"}
    if said := merge_attribution_lines([copyright, *(part.document["asset"].get("copyright", "") for part in parts)]):
        asset["copyright"] = said
    head: JsonObject = {"asset": asset, "scene": 0, "scenes": [scene]}
    if nodes:
        head |= document | {**UNLIT_EXTENSIONS, "samplers": SAMPLERS, "buffers": [{"byteLength": length}]}
    return _write_glb(path, head, parts, length)


def _write_glb(path: Path, document: JsonObject, parts: Sequence[GlbFileHeader], length: int) -> int:
    """Write a document and the binary data of its parts, `length` bytes; returns the size of the file."""
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    total = HEADER_BYTES + 8 + len(text) + (8 + length if length else 0)
    temporary = path.with_suffix(".tmp")
    with temporary.open("wb") as file:
        file.write(struct.pack("<4sIIII", b"glTF", 2, total, len(text), JSON_CHUNK) + text)
        if length:
            file.write(struct.pack("<II", length, BINARY_CHUNK))
        for part in parts:
            with part.path.open("rb") as source:
                source.seek(part.start)
                shutil.copyfileobj(source, file)  # the binary chunk is the last
    os.replace(temporary, path)
    return total


def _append_document(
    document: JsonObject, part: JsonObject, first: Mapping[str, int], offset: int, origin: Sequence[float]
) -> None:
    """Append the lists of a part's document; `offset` is the start of its binary data in the merged buffer."""
    if "nodes" not in part:
        return
    views, pictures = first["bufferViews"], first["images"]
    document["accessors"] += [one | {"bufferView": one["bufferView"] + views} for one in part["accessors"]]
    document["bufferViews"] += [one | {"byteOffset": one["byteOffset"] + offset} for one in part["bufferViews"]]
    document["images"] += [one | {"bufferView": one["bufferView"] + views} for one in part.get("images", ())]
    document["textures"] += [one | {"source": one["source"] + pictures} for one in part.get("textures", ())]
    for number, one in enumerate(part["materials"], first["materials"]):
        surface = one["pbrMetallicRoughness"]
        if "baseColorTexture" not in surface:
            document["materials"].append(one)
            continue
        shown = {"index": surface["baseColorTexture"]["index"] + first["textures"]}
        document["materials"].append(
            one | {"name": f"page-{number}", "pbrMetallicRoughness": surface | {"baseColorTexture": shown}}
        )
    document["meshes"] += [_renumber_mesh(one, first) for one in part["meshes"]]
    x, y, z = (mine - theirs for mine, theirs in zip(part["scenes"][0]["extras"]["origin"], origin, strict=True))
    moved = (x, z, -y)  # as glTF has it, y up
    for one in part["nodes"]:
        place = [a + b for a, b in zip(one.get("translation", (0, 0, 0)), moved, strict=True)]
        document["nodes"].append(one | {"mesh": one["mesh"] + first["meshes"], "translation": place})


def _renumber_mesh(mesh: JsonObject, first: Mapping[str, int]) -> JsonObject:
    drawn = [
        {
            "attributes": {key: index + first["accessors"] for key, index in primitive["attributes"].items()},
            "indices": primitive["indices"] + first["accessors"],
            "material": primitive["material"] + first["materials"],
        }
        for primitive in mesh["primitives"]
    ]
    return mesh | {"primitives": drawn}
