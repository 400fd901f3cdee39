"""GLB content of a tile: one quantised primitive per texture page, with feature ids of one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, IntArray
from facade_core.export.models.buffers import (
    BYTE,
    ELEMENT_ARRAY_BUFFER,
    MAX_UNSIGNED_SHORT,
    UNSIGNED_INT,
    UNSIGNED_SHORT,
    GlbBuffer,
)
from facade_core.export.models.encoders import TextureEncoder
from facade_core.export.models.features import FEATURE_ID_LABELS, FeatureTable, add_feature_ids
from facade_core.export.models.glb import SAMPLERS, pack_glb, quantise_directions
from facade_core.export.models.gltf_materials import MaterialTextures, TimeOfDay, build_gltf_materials

# Minimum step of quantised positions, metres; steps are powers of two that tiles of a size share, so there are no cracks.
MIN_STEP_M = 2.0**-10


@dataclass(frozen=True)
class TileBatch:
    """Triangles of a tile with one texture page, in glTF's frame (y up).

    Attributes
    ----------
    position : (v, 3) metres.
    normal : (v, 3) unit vectors.
    uv : (v, 2) texture coordinates 0 to 1, v down.
    triangles : (t, 3) vertex indices.
    rows : (v, 2) feature rows of the part and the building of a vertex.
    tangent : (v, 4) unit vectors along u with handedness; only of relit meshes.
    """

    position: Float64Array
    normal: Float64Array
    uv: Float64Array
    triangles: IntArray
    rows: IntArray
    tangent: Float64Array | None = None


def encode_tile_glb(
    batches: Sequence[TileBatch],
    pages: Sequence[MaterialTextures],
    encoder: TextureEncoder,
    features: FeatureTable,
    copyright: str,
    time: TimeOfDay = "day",
) -> bytes:
    """Encode batches as GLB; batch i shows page i.

    Parameters
    ----------
    batches : triangles by page.
    pages : textures by page.
    encoder : encoder of the textures.
    features : feature table of the block.
    copyright : attribution.
    time : time of day shown by emissive materials.
    """
    materials = build_gltf_materials(pages, encoder, time)
    buffer = GlbBuffer()
    everything = np.concatenate([batch.position for batch in batches])
    low, step = quantisation_grid(everything)
    used, index = np.unique(np.concatenate([batch.rows for batch in batches]), return_inverse=True)
    index = index.reshape(-1, len(FEATURE_ID_LABELS))
    primitives = []
    start = 0
    for number, batch in enumerate(batches):
        place = np.round((batch.position - low) / step).astype("<u2")
        ids = index[start : start + len(batch.position)]
        start += len(batch.position)
        bounds = {"min": place.min(axis=0).tolist(), "max": place.max(axis=0).tolist()}
        attributes = {
            "POSITION": buffer.add_accessor(place, UNSIGNED_SHORT, "VEC3", **bounds),
            "NORMAL": buffer.add_accessor(quantise_directions(batch.normal), BYTE, "VEC3", normalized=True),
            "TEXCOORD_0": buffer.add_accessor(
                np.round(batch.uv * MAX_UNSIGNED_SHORT).astype("<u2"), UNSIGNED_SHORT, "VEC2", normalized=True
            ),
        }
        if batch.tangent is not None:
            along = quantise_directions(batch.tangent)
            attributes["TANGENT"] = buffer.add_accessor(along, BYTE, "VEC4", normalized=True)
        named, mesh_features = add_feature_ids(ids, len(used), buffer)
        wide = len(batch.position) > MAX_UNSIGNED_SHORT
        triangles = batch.triangles.astype("<u4" if wide else "<u2").reshape(-1, 1)
        primitives.append(
            {
                "attributes": attributes | named,
                "indices": buffer.add_accessor(
                    triangles, UNSIGNED_INT if wide else UNSIGNED_SHORT, "SCALAR", target=ELEMENT_ARRAY_BUFFER
                ),
                "material": number,
                "extensions": {"EXT_mesh_features": mesh_features},
            }
        )
    metadata = features.structural_metadata(used, buffer.add_view)
    images = [{"bufferView": buffer.add_view(picture), "mimeType": encoder.mime_type} for picture in materials.images]
    required = [encoder.extension] if encoder.extension else []
    document: dict[str, object] = {
        "asset": {"version": "2.0", "generator": "Streetloom", **({"copyright": copyright} if copyright else {})},
        "extensionsUsed": [
            "KHR_mesh_quantization",
            "EXT_mesh_features",
            "EXT_structural_metadata",
            *materials.extensions_used,
        ],
        "extensionsRequired": ["KHR_mesh_quantization", *required],
        "extensions": {"EXT_structural_metadata": metadata},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": low.tolist(), "scale": [step] * 3}],
        "meshes": [{"primitives": primitives}],
        "materials": materials.document_parts["materials"],
        "textures": materials.document_parts["textures"],
        "images": images,
        "samplers": SAMPLERS,
        **buffer.document_parts,
    }
    return pack_glb(document, buffer.chunks)


def quantisation_grid(points: Float64Array) -> tuple[Float64Array, float]:
    """Return origin (3,) and step of the grid on which points fit 16 bits.

    Parameters
    ----------
    points : (n, 3) metres.

    Returns
    -------
    The origin, a multiple of the step, and the step, a power of two, metres.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    step = MIN_STEP_M
    while float((high - low).max()) / step > MAX_UNSIGNED_SHORT - 2:
        step *= 2
    return np.floor(low / step) * step, step
