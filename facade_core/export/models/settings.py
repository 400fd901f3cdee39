"""Settings of models."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """Numbers of the encoders of textures.

    Attributes
    ----------
    webp_quality : quality of WebP, 0 to 100, chosen by eye.
    etc1s_quality : quality of ETC1S, 0 to 100, chosen by eye.
    etc1s_effort : effort of the ETC1S encoder.
    jpeg_data_quality : quality of JPEG for data such as normals.
    max_view_mb : limit for the textures of a view, MB: CesiumJS caches 512 MiB of tiles with their contents,
        3d-tiles-renderer 0.4 GiB; a view above that is evicted and loaded again endlessly, and the tiles of the
        previous view need room too.
    max_ktx2_view_mb : limit for KTX2, which is chosen for small graphics cards, MB.
    """

    webp_quality: int = 85
    etc1s_quality: int = 90
    etc1s_effort: int = 1
    jpeg_data_quality: int = 80
    max_view_mb: float = 300.0
    max_ktx2_view_mb: float = 120.0


TEXTURE_ENCODERS = EncoderSettings()


@dataclass(frozen=True, slots=True)
class MeshSettings:
    """Numbers of textured meshes.

    Attributes
    ----------
    min_triangle_m2 : smaller triangles are invisible, m2.
    max_cached_pages : decoded atlas pages in the cache; the charts of a building are on few consecutive pages.
    """

    min_triangle_m2: float = 1e-8
    max_cached_pages: int = 12


TEXTURED_MESHES = MeshSettings()


@dataclass(frozen=True, slots=True)
class MaterialSettings:
    """Numbers of materials.

    Attributes
    ----------
    emissive_strength : brightness of lit windows relative to white, so that they shine without changing their
        hue.
    default_roughness : roughness of charts without maps: plaster, stone and brick scatter light.
    index_of_refraction : index of refraction of every material.
    """

    emissive_strength: float = 3.0
    default_roughness: float = 0.9
    index_of_refraction: float = 1.5


GLTF_MATERIALS = MaterialSettings()
