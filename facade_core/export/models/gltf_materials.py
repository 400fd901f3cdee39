"""glTF materials: unlit images, or physically based materials with normal, occlusion, roughness and emissive textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from facade_core.core.json_types import JsonObject
from facade_core.export.models.encoders import ENCODERS, TextureEncoder
from facade_core.export.models.pages import PageImages

# Brightness of lit windows relative to white, so that they shine without changing their hue.
EMISSIVE_STRENGTH = 3.0
# Names of the variants.
DAY = "day"
NIGHT = "night"
# Emission by day never, by night always, or as the viewer chooses, with the first as the default.
TimeOfDay = Literal["day", "night", "day or night", "night or day"]


def material_texel_ratio(has_maps: bool, time: TimeOfDay) -> float:
    """Return the texels of all textures of a page per texel of its base colour, at most.

    A map has a quarter of the texels of the base colour.
    """
    return 1.0 + (0.25 * (2 if time == DAY else 3) if has_maps else 0.0)


@dataclass(frozen=True)
class MaterialTextures:
    """Encoded textures of a page; unlit without normals, without emission at night where `emissive` is None.

    Attributes
    ----------
    base_colour : colour, sRGB.
    normal : tangent-space normals.
    orm : occlusion, roughness and metalness in red, green and blue.
    emissive : light of windows at night, sRGB.
    """

    base_colour: bytes
    normal: bytes | None = None
    orm: bytes | None = None
    emissive: bytes | None = None


def encode_textures(images: PageImages, encoder: TextureEncoder) -> MaterialTextures:
    """Encode the images of a page."""
    maps = images.maps
    if maps is None:
        return MaterialTextures(encoder.encode(images.base_colour))
    return MaterialTextures(
        encoder.encode(images.base_colour),
        encoder.encode_data(maps.normal),
        encoder.encode_data(maps.orm),
        None if maps.emissive is None else encoder.encode(maps.emissive),
    )


@dataclass(frozen=True)
class GltfMaterials:
    """Parts of a glTF document that describe materials.

    Attributes
    ----------
    images : encoded images in the order of the textures' sources; the caller adds them to the document.
    document_parts : materials, textures and extensions of the document.
    extensions_used : names of the extensions.
    primitives : per material, the properties of a primitive that uses it.
    """

    images: tuple[bytes, ...]
    document_parts: JsonObject
    extensions_used: tuple[str, ...]
    primitives: tuple[JsonObject, ...]


def build_gltf_materials(
    pages: Sequence[MaterialTextures], encoder: TextureEncoder = ENCODERS["jpeg"], time: TimeOfDay = "day"
) -> GltfMaterials:
    """Build one glTF material per page for a time of day.

    With a choice of time ("day or night"), emissive pages get two materials as KHR_materials_variants.
    """
    pictures: list[bytes] = []
    textures: list[dict[str, object]] = []
    used = [encoder.extension] if encoder.extension else []

    def texture(picture: bytes) -> dict[str, int]:
        source = {"source": len(pictures)}
        textures.append(
            {"sampler": 0, **({"extensions": {encoder.extension: source}} if encoder.extension else source)}
        )
        pictures.append(picture)
        return {"index": len(textures) - 1}

    choice, first = " or " in time, time.partition(" ")[0]
    materials: list[dict[str, object]] = []
    after: list[dict[str, object]] = []  # those of night where the first is day, and the other way round
    primitives: list[dict[str, object]] = [{"material": i} for i in range(len(pages))]
    for i, page in enumerate(pages):
        shown: JsonObject = {
            "name": f"page-{i}",
            "pbrMetallicRoughness": {
                "baseColorTexture": texture(page.base_colour),
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }
        if page.normal is None or page.orm is None:
            materials.append(shown | {"extensions": {"KHR_materials_unlit": {}}})
            used.append("KHR_materials_unlit")
            continue
        orm = texture(page.orm)
        shown["pbrMetallicRoughness"]["metallicRoughnessTexture"] = orm
        shown |= {"normalTexture": texture(page.normal), "occlusionTexture": orm}
        if page.emissive is None or time == DAY:
            materials.append(shown)
            continue
        by_night = shown | {
            "name": f"page-{i}-{NIGHT}" if choice else f"page-{i}",
            "emissiveTexture": texture(page.emissive),
            "emissiveFactor": [1.0, 1.0, 1.0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": EMISSIVE_STRENGTH}},
        }
        used.append("KHR_materials_emissive_strength")
        materials.append(by_night if first == NIGHT else shown)
        if choice:
            used.append("KHR_materials_variants")
            other = len(pages) + len(after)
            after.append(shown if first == NIGHT else by_night)
            day, night = (other, i) if first == NIGHT else (i, other)
            mappings = [{"material": day, "variants": [0]}, {"material": night, "variants": [1]}]
            primitives[i] = {"material": i, "extensions": {"KHR_materials_variants": {"mappings": mappings}}}
    document: JsonObject = {"materials": materials + after, "textures": textures}
    if "KHR_materials_variants" in used:
        document["extensions"] = {"KHR_materials_variants": {"variants": [{"name": DAY}, {"name": NIGHT}]}}
    return GltfMaterials(tuple(pictures), document, tuple(dict.fromkeys(used)), tuple(primitives))
