"""GLB of a factored model: repeated textures, vertex colours that multiply them, and feature ids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, FloatArray, IntArray
from facade_core.export.models.buffers import (
    ELEMENT_ARRAY_BUFFER,
    FLOAT,
    MAX_UNSIGNED_SHORT,
    UNSIGNED_INT,
    UNSIGNED_SHORT,
    GlbBuffer,
)
from facade_core.export.models.encoders import TextureEncoder
from facade_core.export.models.features import FEATURE_ID_LABELS, FeatureTable, add_feature_ids
from facade_core.export.models.glb import SAMPLERS, pack_glb
from facade_core.export.models.gltf_materials import MaterialTextures, build_gltf_materials

# glTF wrapping mode REPEAT.
REPEAT_WRAP = 10497


@dataclass(frozen=True, eq=False)
class FactoredPrimitive:
    """Triangles with one texture, in glTF's frame (y up).

    Attributes
    ----------
    position, normal : (v, 3).
    uv : (v, 2) texture coordinates.
    colour : (v, 3) linear factor on the texture, 0 to 1.
    triangles : (t, 3) vertex indices.
    chart : (v,) chart of each vertex.
    """

    position: Float64Array
    normal: Float64Array
    uv: Float64Array
    colour: FloatArray
    triangles: IntArray
    chart: IntArray


def encode_factored_glb(
    nodes: Mapping[str, Mapping[int, FactoredPrimitive]],
    pictures: Sequence[bytes | str],
    repeated: Sequence[bool],
    encoder: TextureEncoder,
    features: FeatureTable,
    *,
    extras: Mapping[str, object],
    copyright: str,
) -> bytes:
    """Encode a factored model as GLB with unlit materials, whose colours contain the light of the day.

    Parameters
    ----------
    nodes : parts by node name and texture.
    pictures : encoded image of each texture, or its URI relative to the model; unused ones are left out.
    repeated : True for textures that repeat.
    encoder : encoder of the images.
    features : feature table of the block.
    extras : extras of the scene.
    copyright : attribution.
    """
    buffer = GlbBuffer()
    shown = sorted(set().union(*nodes.values()))
    meshes, used = _add_meshes(buffer, nodes, shown, features)
    metadata = features.structural_metadata(used, buffer.add_view)
    # an unlit material has one image
    materials = build_gltf_materials([MaterialTextures(b"")] * len(shown), encoder)
    images = [_image_entry(buffer, pictures[texture], encoder) for texture in shown]
    for texture, entry in zip(shown, materials.document_parts["textures"], strict=True):
        entry["sampler"] = int(repeated[texture])
    required = [encoder.extension] if encoder.extension else []
    document: dict[str, object] = {
        "asset": {"version": "2.0", "generator": "Streetloom", **({"copyright": copyright} if copyright else {})},
        "extensionsUsed": [
            *sorted({*materials.extensions_used, *required}),
            "EXT_mesh_features",
            "EXT_structural_metadata",
        ],
        **({"extensionsRequired": required} if required else {}),
        "extensions": {"EXT_structural_metadata": metadata},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes))), "extras": dict(extras)}],
        "nodes": [{"name": mesh["name"], "mesh": i} for i, mesh in enumerate(meshes)],
        "meshes": meshes,
        "materials": materials.document_parts["materials"],
        "textures": materials.document_parts["textures"],
        "images": images,
        "samplers": [*SAMPLERS, {**SAMPLERS[0], "wrapS": REPEAT_WRAP, "wrapT": REPEAT_WRAP}],
        **buffer.document_parts,
    }
    return pack_glb(document, buffer.chunks)


def _add_meshes(
    buffer: GlbBuffer,
    nodes: Mapping[str, Mapping[int, FactoredPrimitive]],
    shown: Sequence[int],
    features: FeatureTable,
) -> tuple[list[dict[str, object]], IntArray]:
    """Add the parts of all nodes to a buffer; returns their meshes and the rows of the feature table that they use."""
    every = [part for parts in nodes.values() for _, part in sorted(parts.items())]
    chart = np.concatenate([part.chart for part in every])
    rows = np.column_stack([features.chart_rows[chart], features.owner_rows[chart]])
    used, index = np.unique(rows, return_inverse=True)
    index = index.reshape(-1, len(FEATURE_ID_LABELS))
    ids = iter(np.split(index, np.cumsum([len(part.chart) for part in every])[:-1]))
    meshes: list[dict[str, object]] = []
    for name, parts in nodes.items():
        primitives = [
            _add_primitive(buffer, part, next(ids), len(used), shown.index(texture))
            for texture, part in sorted(parts.items())
        ]
        meshes.append({"name": name, "primitives": primitives})
    return meshes, used


def _add_primitive(
    buffer: GlbBuffer, part: FactoredPrimitive, ids: IntArray, feature_count: int, material: int
) -> dict[str, object]:
    """Add the vertices, feature ids and triangles of a part to a buffer and return its primitive."""
    position = part.position.astype("<f4")
    colour = np.rint(part.colour * MAX_UNSIGNED_SHORT).astype("<u2")
    attributes = {
        "POSITION": buffer.add_accessor(
            position, FLOAT, "VEC3", min=position.min(axis=0).tolist(), max=position.max(axis=0).tolist()
        ),
        "NORMAL": buffer.add_accessor(part.normal.astype("<f4"), FLOAT, "VEC3"),
        "TEXCOORD_0": buffer.add_accessor(part.uv.astype("<f4"), FLOAT, "VEC2"),
        "COLOR_0": buffer.add_accessor(colour, UNSIGNED_SHORT, "VEC3", normalized=True),
    }
    named, mesh_features = add_feature_ids(ids, feature_count, buffer)
    triangles = part.triangles.astype("<u4").reshape(-1, 1)
    return {
        "attributes": attributes | named,
        "indices": buffer.add_accessor(triangles, UNSIGNED_INT, "SCALAR", target=ELEMENT_ARRAY_BUFFER),
        "material": material,
        "extensions": {"EXT_mesh_features": mesh_features},
    }


def _image_entry(buffer: GlbBuffer, picture: bytes | str, encoder: TextureEncoder) -> dict[str, object]:
    if isinstance(picture, str):
        return {"uri": picture}
    return {"bufferView": buffer.add_view(picture), "mimeType": encoder.mime_type}
