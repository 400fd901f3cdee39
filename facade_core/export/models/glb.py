"""Writer of binary glTF 2.0; encoded images are embedded byte for byte."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Mapping, Sequence
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
    UNSIGNED_BYTE,
    UNSIGNED_INT,
    UNSIGNED_SHORT,
    GlbBuffer,
)
from facade_core.export.models.gltf_materials import GltfMaterials, MaterialTextures, TimeOfDay, build_gltf_materials

# NumPy dtypes of component types.
COMPONENT_DTYPES = {
    BYTE: "i1",
    UNSIGNED_BYTE: "u1",
    5122: "<i2",
    UNSIGNED_SHORT: "<u2",
    UNSIGNED_INT: "<u4",
    FLOAT: "<f4",
}
# glTF filters.
LINEAR = 9729
LINEAR_MIPMAP_LINEAR = 9987
# glTF wrapping mode CLAMP_TO_EDGE.
CLAMP_TO_EDGE = 33071
# Largest quantised value of a signed byte.
MAX_BYTE = 127
# Extensions of models with unlit materials only.
UNLIT_EXTENSIONS = {"extensionsUsed": ["KHR_materials_unlit"]}
# Accessor types by attribute.
ACCESSOR_TYPES = {"POSITION": "VEC3", "NORMAL": "VEC3", "TEXCOORD_0": "VEC2", "TANGENT": "VEC4", "indices": "SCALAR"}
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
    append: Callable[[JsonObject, GlbBuffer], None] | None = None,
) -> bytes:
    """Encode nodes as GLB, one glTF node each, with JPEG images embedded unchanged.

    Materials of a plain image are unlit, because a photo already contains the light of its day. Their primitives have no
    normals; those of lit materials have normals and tangents of bytes.

    Parameters
    ----------
    nodes : nodes of the model; those without primitives are left out.
    materials : textures of each material, or its JPEG alone.
    extras : extras of the scene.
    copyright : attribution in the asset.
    time : time of day shown by emissive materials.
    append : adds further nodes to the document and its buffer.
    """
    pages = [one if isinstance(one, MaterialTextures) else MaterialTextures(one) for one in materials]
    gltf = build_gltf_materials(pages, time=time)
    nodes = [node for node in nodes if node.primitives]
    buffer = GlbBuffer()
    geometry = _add_vertices(buffer, list(chain.from_iterable(node.primitives for node in nodes)), pages)
    pictures = list(map(buffer.add_view, gltf.images))
    document = _document_head(len(nodes), extras, copyright)
    if nodes:
        document |= {
            **_list_extensions(gltf, any(not page.is_unlit for page in pages)),
            "nodes": [{"name": node.name, "mesh": i} for i, node in enumerate(nodes)],
            "meshes": _build_meshes(nodes, geometry, gltf),
            **gltf.document_parts,
            "images": [{"bufferView": view, "mimeType": "image/jpeg"} for view in pictures],
            "samplers": SAMPLERS,
            **buffer.document_parts,
        }
    if append is not None:
        append(document, buffer)
        document |= buffer.document_parts
    return pack_glb(document, buffer.chunks)


def _list_extensions(gltf: GltfMaterials, has_normals: bool) -> JsonObject:
    """Return the lists of extensions of a document; normals of bytes are an extension."""
    quantised = ["KHR_mesh_quantization"] if has_normals else []
    used = [*quantised, *gltf.extensions_used]
    return ({"extensionsUsed": used} if used else {}) | ({"extensionsRequired": quantised} if quantised else {})


def _document_head(node_count: int, extras: Mapping[str, object] | None, copyright: str) -> JsonObject:
    asset = {"version": "2.0", "generator": "Streetloom", **({"copyright": copyright} if copyright else {})}
    scene: JsonObject = {"nodes": list(range(node_count))} if node_count else {}
    if extras:
        scene["extras"] = dict(extras)
    return {"asset": asset, "scene": 0, "scenes": [scene]}


def _add_vertices(
    buffer: GlbBuffer, primitives: Sequence[Primitive], pages: Sequence[MaterialTextures]
) -> list[JsonObject]:
    """Add the arrays of all primitives to a buffer; returns the attributes and indices of each."""
    lit = [not pages[p.material].is_unlit for p in primitives]
    shaded = [p for p, is_lit in zip(primitives, lit, strict=True) if is_lit]
    arrays: dict[str, list[NumericArray]] = {
        "POSITION": [np.ascontiguousarray(p.position, "<f4") for p in primitives],
        "TEXCOORD_0": [np.ascontiguousarray(p.uv, "<f4") for p in primitives],
        "NORMAL": [quantise_directions(p.normal) for p in shaded],
        "TANGENT": [quantise_directions(p.tangent) for p in shaded if p.tangent is not None],
        "indices": [_index_array(p) for p in primitives],
    }
    accessors = {name: iter(_add_shared_view(buffer, name, parts)) for name, parts in arrays.items()}
    found: list[JsonObject] = []
    for primitive, is_lit in zip(primitives, lit, strict=True):
        names = ["POSITION", "TEXCOORD_0", *(["NORMAL"] if is_lit else [])]
        names += ["TANGENT"] if is_lit and primitive.tangent is not None else []
        found.append(
            {"attributes": {name: next(accessors[name]) for name in names}, "indices": next(accessors["indices"])}
        )
    return found


def quantise_directions(directions: Float64Array) -> NumericArray:
    """Quantise unit vectors (v, k) to signed bytes in rows of four."""
    rows = np.zeros((len(directions), 4), "i1")
    rows[:, : directions.shape[1]] = np.round(directions * MAX_BYTE)
    return rows


def _index_array(primitive: Primitive) -> NumericArray:
    """Return the indices (3 t, 1) of a primitive, of 16 bits if they fit."""
    is_wide = len(primitive.position) > np.iinfo(np.uint16).max
    return np.ascontiguousarray(primitive.triangles, "<u4" if is_wide else "<u2").reshape(-1, 1)


def _add_shared_view(buffer: GlbBuffer, name: str, parts: Sequence[NumericArray]) -> list[int]:
    """Add the arrays (n, k) of one attribute as accessors of one view, each at a multiple of four bytes."""
    data: list[bytes] = []
    start, first = 0, len(buffer.accessors)
    for part in parts:
        component = next(code for code, dtype in COMPONENT_DTYPES.items() if np.dtype(dtype) == part.dtype)
        accessor: JsonObject = {
            "bufferView": len(buffer.views),
            "byteOffset": start,
            "componentType": component,
            "count": len(part),
            "type": ACCESSOR_TYPES[name],
            **({"normalized": True} if component == BYTE else {}),
        }
        if name == "POSITION":
            accessor |= {"min": part.min(axis=0).tolist(), "max": part.max(axis=0).tolist()}
        buffer.accessors.append(accessor)
        data.append(part.tobytes() + b"\0" * (-part.nbytes % 4))
        start += len(data[-1])
    if parts:
        is_index = name == "indices"
        stride = {} if is_index else {"byteStride": parts[0].itemsize * parts[0].shape[1]}
        buffer.add_view(b"".join(data), target=ELEMENT_ARRAY_BUFFER if is_index else ARRAY_BUFFER, **stride)
    return list(range(first, len(buffer.accessors)))


def _build_meshes(nodes: Sequence[GltfNode], geometry: Sequence[JsonObject], gltf: GltfMaterials) -> list[JsonObject]:
    """Return one mesh per node, whose primitives take their geometry in turn."""
    remaining = iter(geometry)
    return [
        {
            "name": node.name,
            "primitives": [next(remaining) | gltf.primitives[one.material] for one in node.primitives],
        }
        for node in nodes
    ]


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
