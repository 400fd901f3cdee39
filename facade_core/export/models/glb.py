"""Writer of binary glTF 2.0; encoded images are embedded byte for byte."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import BinaryIO

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array, NumericArray
from facade_core.core.json_types import JsonObject
from facade_core.export.models.buffers import (
    ARRAY_BUFFER,
    BYTE,
    ELEMENT_ARRAY_BUFFER,
    FLOAT,
    UNSIGNED_INT,
    UNSIGNED_SHORT,
    GlbBuffer,
)
from facade_core.export.models.gltf_materials import GltfMaterials, MaterialTextures, TimeOfDay, build_gltf_materials

# NumPy dtypes of component types.
COMPONENT_DTYPES = {BYTE: "i1", 5121: "u1", 5122: "<i2", UNSIGNED_SHORT: "<u2", UNSIGNED_INT: "<u4", FLOAT: "<f4"}
# glTF filters.
LINEAR = 9729
LINEAR_MIPMAP_LINEAR = 9987
# glTF wrapping mode CLAMP_TO_EDGE.
CLAMP_TO_EDGE = 33071
# Extensions of models with unlit materials only.
UNLIT_EXTENSIONS = {"extensionsUsed": ["KHR_materials_unlit"]}
# Accessor types by attribute.
ACCESSOR_TYPES = {"position": "VEC3", "normal": "VEC3", "uv": "VEC2", "tangent": "VEC4", "triangles": "SCALAR"}
# GLB chunk types.
JSON_CHUNK = 0x4E4F534A
BINARY_CHUNK = 0x004E4942
# Length of a GLB header, bytes.
HEADER_BYTES = 12
# Samplers of every model.
SAMPLERS = [
    {
        "magFilter": LINEAR,
        "minFilter": LINEAR_MIPMAP_LINEAR,
        "wrapS": CLAMP_TO_EDGE,
        "wrapT": CLAMP_TO_EDGE,
    }
]


@dataclass(frozen=True)
class Primitive:
    """Triangles with one material, in glTF's frame (y up).

    Attributes
    ----------
    position : (v, 3) metres.
    normal : (v, 3) unit vectors.
    uv : (v, 2) texture coordinates 0 to 1, u right and v down.
    triangles : (t, 3) vertex indices, counter-clockwise as seen from outside.
    material : index of the material.
    tangent : (v, 4) unit vectors along u with handedness; only of materials with normal maps.
    """

    position: Float32Array
    normal: Float64Array
    uv: Float64Array
    triangles: Int64Array
    material: int
    tangent: Float64Array | None = None


@dataclass(frozen=True)
class GltfNode:
    """Named node of a model."""

    name: str
    primitives: tuple[Primitive, ...]


def encode_glb(
    nodes: Sequence[GltfNode],
    materials: Sequence[bytes] | Sequence[MaterialTextures],
    *,
    extras: Mapping[str, object] | None = None,
    copyright: str = "",
    time: TimeOfDay = "day",
) -> bytes:
    """Encode nodes as GLB, one glTF node each, with JPEG images embedded unchanged.

    Materials of a plain image are unlit, because a photo already contains the light of its day.

    Parameters
    ----------
    nodes : nodes of the model; those without primitives are left out.
    materials : textures of each material, or its JPEG alone.
    extras : extras of the scene.
    copyright : attribution in the asset.
    time : time of day shown by emissive materials.
    """
    pages = [one if isinstance(one, MaterialTextures) else MaterialTextures(one) for one in materials]
    gltf = build_gltf_materials(pages, time=time)
    nodes = [node for node in nodes if node.primitives]
    buffer = GlbBuffer()
    first = _add_vertices(buffer, list(chain.from_iterable(node.primitives for node in nodes)))
    pictures = list(map(buffer.add_view, gltf.images))
    document = _document_head(len(nodes), extras, copyright)
    if nodes:
        document |= {
            **({"extensionsUsed": list(gltf.extensions_used)} if gltf.extensions_used else {}),
            "nodes": [{"name": node.name, "mesh": i} for i, node in enumerate(nodes)],
            "meshes": _build_meshes(nodes, first, gltf),
            **gltf.document_parts,
            "images": [{"bufferView": view, "mimeType": "image/jpeg"} for view in pictures],
            "samplers": SAMPLERS,
            **buffer.document_parts,
        }
    return pack_glb(document, buffer.chunks)


def _document_head(node_count: int, extras: Mapping[str, object] | None, copyright: str) -> JsonObject:
    asset = {"version": "2.0", "generator": "Streetloom", **({"copyright": copyright} if copyright else {})}
    scene: JsonObject = {"nodes": list(range(node_count))} if node_count else {}
    if extras:
        scene["extras"] = dict(extras)
    return {"asset": asset, "scene": 0, "scenes": [scene]}


def _add_vertices(buffer: GlbBuffer, primitives: Sequence[Primitive]) -> dict[str, int]:
    """Add the arrays of all primitives to a buffer; returns the first accessor of each attribute."""
    arrays = {
        "position": [np.ascontiguousarray(p.position, "<f4") for p in primitives],
        "normal": [np.ascontiguousarray(p.normal, "<f4") for p in primitives],
        "uv": [np.ascontiguousarray(p.uv, "<f4") for p in primitives],
        "tangent": [np.ascontiguousarray(p.tangent, "<f4") for p in primitives if p.tangent is not None],
        "triangles": [np.ascontiguousarray(p.triangles, "<u4").reshape(-1, 1) for p in primitives],
    }
    first = {}
    for name, parts in arrays.items():
        first[name] = len(buffer.accessors)
        _add_shared_view(buffer, name, parts)
    return first


def _add_shared_view(buffer: GlbBuffer, name: str, parts: Sequence[NumericArray]) -> None:
    """Add the arrays (n, k) of one attribute as accessors of one view."""
    is_index = name == "triangles"
    start = 0
    for part in parts:
        accessor: JsonObject = {
            "bufferView": len(buffer.views),
            "byteOffset": start,
            "componentType": UNSIGNED_INT if is_index else FLOAT,
            "count": len(part),
            "type": ACCESSOR_TYPES[name],
        }
        if name == "position":
            accessor |= {"min": part.min(axis=0).tolist(), "max": part.max(axis=0).tolist()}
        buffer.accessors.append(accessor)
        start += part.nbytes
    if parts:
        stride = {} if is_index else {"byteStride": 4 * parts[0].shape[1]}
        target = ELEMENT_ARRAY_BUFFER if is_index else ARRAY_BUFFER
        buffer.add_view(b"".join(part.tobytes() for part in parts), target=target, **stride)


def _build_meshes(nodes: Sequence[GltfNode], first: Mapping[str, int], gltf: GltfMaterials) -> list[JsonObject]:
    """Return one mesh per node; its primitives refer to accessors that count on from `first`."""
    meshes: list[JsonObject] = []
    count = leaning = 0
    for node in nodes:
        drawn = []
        for primitive in node.primitives:
            attributes = {"POSITION": "position", "NORMAL": "normal", "TEXCOORD_0": "uv"}
            of = {key: first[name] + count for key, name in attributes.items()}
            if primitive.tangent is not None:
                of["TANGENT"] = first["tangent"] + leaning
                leaning += 1
            drawn.append(
                {"attributes": of, "indices": first["triangles"] + count, **gltf.primitives[primitive.material]}
            )
            count += 1
        meshes.append({"name": node.name, "primitives": drawn})
    return meshes


def pack_glb(document: Mapping[str, object], chunks: Sequence[bytes]) -> bytes:
    """Pack a glTF document and its buffer as GLB.

    Parameters
    ----------
    document : glTF document.
    chunks : parts of the buffer; together a multiple of four bytes.
    """
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    # property tables need a buffer that starts at a multiple of eight bytes
    text += b" " * (-(HEADER_BYTES + 8 + len(text) + 8) % 8)
    body = [struct.pack("<II", len(text), JSON_CHUNK), text]
    if length := sum(map(len, chunks)):
        body += [struct.pack("<II", length, BINARY_CHUNK), *chunks]
    return b"".join([struct.pack("<4sII", b"glTF", 2, HEADER_BYTES + sum(map(len, body))), *body])


def read_glb_header(file: BinaryIO) -> tuple[JsonObject, int]:
    """Read the JSON document of a GLB file and the offset of its binary data.

    Raises
    ------
    ValueError : the file is not a GLB.
    """
    head = file.read(HEADER_BYTES + 8)
    magic, _, _, length, name = struct.unpack("<4sIIII", head) if len(head) == HEADER_BYTES + 8 else (b"", 0, 0, 0, 0)
    if magic != b"glTF" or name != JSON_CHUNK:
        raise ValueError("it is no GLB file")
    return json.loads(file.read(length)), HEADER_BYTES + 8 + length + 8


def replace_copyright(glb: bytes, copyright: str) -> bytes:
    """Return the same model with another copyright in its asset."""
    document, data = read_glb_header(io.BytesIO(glb))
    said = document | {"asset": document["asset"] | {"copyright": copyright}}
    return pack_glb(said, [glb[data:]] if len(glb) > data else [])


def extract_images(glb: bytes) -> list[bytes]:
    """Return the encoded images of a model that `encode_glb` wrote."""
    document, data = read_glb_header(io.BytesIO(glb))
    views = [document["bufferViews"][image["bufferView"]] for image in document.get("images", [])]
    return [glb[data + view["byteOffset"] : data + view["byteOffset"] + view["byteLength"]] for view in views]


def tangent_vectors(along: Float64Array) -> Float32Array:
    """Return the TANGENT attribute for textures with x right and v down.

    Parameters
    ----------
    along : (v, 3) unit vectors along u.

    Returns
    -------
    (v, 4) float32.
    """
    return np.column_stack([along, np.ones(len(along))]).astype("<f4")
