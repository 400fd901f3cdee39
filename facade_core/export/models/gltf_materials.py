"""glTF materials: unlit images, or physically based materials with normal, occlusion, roughness and emissive textures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from facade_core.core.json_types import JsonObject
from facade_core.export.models.encoders import ENCODERS, TextureEncoder
from facade_core.export.models.pages import PageImages
from facade_core.export.models.settings import GLTF_MATERIALS

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

    @property
    def is_unlit(self) -> bool:
        """Return True if the page has no maps."""
        return self.normal is None or self.orm is None


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

    has_choice, first = " or " in time, time.partition(" ")[0]
    materials: list[JsonObject] = []
    after: list[JsonObject] = []  # those of night where the first is day, and the other way round
    primitives: list[JsonObject] = []
    for i, page in enumerate(pages):
        primitives.append({"material": i})
        by_day = _day_material(f"page-{i}", page, texture)
        if page.is_unlit:
            used.append("KHR_materials_unlit")
        if page.is_unlit or page.emissive is None or time == DAY:
            materials.append(by_day)
            continue
        name = f"page-{i}-{NIGHT}" if has_choice else f"page-{i}"
        by_night = by_day | _emission(texture(page.emissive)) | {"name": name}
        used.append("KHR_materials_emissive_strength")
        shown = {DAY: by_day, NIGHT: by_night}
        materials.append(shown.pop(first))
        if has_choice:
            used.append("KHR_materials_variants")
            numbers = {first: i, next(iter(shown)): len(pages) + len(after)}
            after += shown.values()
            primitives[i] |= _variants(numbers)
    document: JsonObject = {"materials": materials + after, "textures": textures}
    if "KHR_materials_variants" in used:
        document["extensions"] = {"KHR_materials_variants": {"variants": [{"name": DAY}, {"name": NIGHT}]}}
    return GltfMaterials(tuple(pictures), document, tuple(dict.fromkeys(used)), tuple(primitives))


def _day_material(name: str, page: MaterialTextures, texture: Callable[[bytes], dict[str, int]]) -> JsonObject:
    """Return the material of a page without emission; `texture` adds a picture and returns its reference."""
    surface: JsonObject = {
        "baseColorTexture": texture(page.base_colour),
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    }
    material: JsonObject = {"name": name, "pbrMetallicRoughness": surface}
    if page.normal is None or page.orm is None:
        return material | {"extensions": {"KHR_materials_unlit": {}}}
    orm = texture(page.orm)
    surface["metallicRoughnessTexture"] = orm
    return material | {"normalTexture": texture(page.normal), "occlusionTexture": orm}


def _emission(texture: dict[str, int]) -> JsonObject:
    return {
        "emissiveTexture": texture,
        "emissiveFactor": [1.0, 1.0, 1.0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": GLTF_MATERIALS.emissive_strength}},
    }


def _variants(numbers: Mapping[str, int]) -> JsonObject:
    """Return the extension of a primitive with one material by day and another by night."""
    mappings = [{"material": numbers[time], "variants": [k]} for k, time in enumerate((DAY, NIGHT))]
    return {"extensions": {"KHR_materials_variants": {"mappings": mappings}}}
