"""Extensions, material pictures and texture coordinates of glTF."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catalogs.readers.material_colours import parse_colour_shares
from catalogs.readers.settings import MODELS
from catalogs.readers.vectors.colours import Colour
from facade_core.core.arrays import AnyArray, Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

TEXTURE_TRANSFORM = "KHR_texture_transform"
_SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
# Extensions of a texture that name another picture, in order of preference.
_PICTURE_EXTENSIONS = ("EXT_texture_webp",)
# Required extensions that are read, or that change neither shape nor base colour.
_SUPPORTED_EXTENSIONS = frozenset((
    *_PICTURE_EXTENSIONS, TEXTURE_TRANSFORM, _SPECULAR_GLOSSINESS, "KHR_mesh_quantization", "KHR_materials_unlit",
    "KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_sheen",
    "KHR_materials_specular", "KHR_lights_punctual", "KHR_xmp_json_ld", "EXT_mesh_features", "EXT_structural_metadata",
))  # fmt: skip
# Extensions without which the shape is wrong, even where the file does not require them.
_COMPRESSION_EXTENSIONS = frozenset(
    ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
)
_EARTH_CENTRE = "CESIUM_RTC"
_INSTANCING = "EXT_mesh_gpu_instancing"
# Largest value by component type: normalised integers are shares of it.
_MAX_COMPONENT = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
_TRIANGLE_FAN = 6
_REPEAT = 10497  # code of the wrapping mode
# Names under which extras state the frame, lower-case.
_EPSG_CODE = re.compile(r"(?:^|EPSG\b.*\D)(\d{4,6})$", re.IGNORECASE)
_FRAME_KEYS = frozenset(("epsg", "crs", "srs", "epsg_code", "coordinatereferencesystem", "referencesystem"))
_WHITE = (255, 255, 255)


@dataclass(frozen=True, slots=True)
class BaseColourTexture:
    """Picture of a material and the placement of its texture coordinates.

    Attributes
    ----------
    uri : URI of the picture; empty where it is embedded or of a format that is not read.
    coordinate_set : number n of the attribute TEXCOORD_n.
    transform : (2, 3) affine transform of the texture coordinates.
    repeats : the picture repeats beyond its borders.
    """

    uri: str
    coordinate_set: int
    transform: Float64Array
    repeats: bool = True

    def apply_transform(self, uv: Float64Array) -> Float64Array:
        """Return the transformed coordinates (n, 2), v down."""
        return uv @ self.transform[:, :2].T + self.transform[:, 2]


def check_extensions(path: Path, header: JsonObject) -> None:
    """Raise InputError where a file needs an extension or a kind of geometry that is not read."""
    for problem, is_found in (_extension_problems(header) | _geometry_problems(header)).items():
        if is_found:
            raise InputError(f"{path} {problem}")


def _extension_problems(header: JsonObject) -> dict[str, object]:
    used, required = ({*map(str, header.get(key) or [])} for key in ("extensionsUsed", "extensionsRequired"))
    packed = sorted(_COMPRESSION_EXTENSIONS & (used | required))
    unknown = required - _SUPPORTED_EXTENSIONS - {_EARTH_CENTRE}
    unknown |= {_INSTANCING for node in header.get("nodes", []) if _INSTANCING in node.get("extensions", {})}
    return {
        f"is compressed ({', '.join(packed)}); export it without compression": packed,
        f"is placed from the centre of the Earth ({_EARTH_CENTRE}), as 3D Tiles are; export it in a projected frame": (
            _EARTH_CENTRE in used | required
        ),
        f"needs {', '.join(sorted(unknown))}, which is not read; export it without": unknown,
    }


def _geometry_problems(header: JsonObject) -> dict[str, object]:
    nodes, meshes = header.get("nodes", []), header.get("meshes", [])
    primitives = [primitive for mesh in meshes for primitive in mesh["primitives"]]
    has_targets = any(primitive.get("targets") for primitive in primitives)
    return {
        "has morph targets, which are not read; export the shape that is meant": (
            has_targets and any(any(item.get("weights") or []) for item in (*meshes, *nodes))
        ),
        "has skins, which are not read; export the shape that is meant": any("skin" in node for node in nodes),
        "has triangle fans, which are not read; export it as triangles": any(
            primitive.get("mode") == _TRIANGLE_FAN for primitive in primitives
        ),
        "has sparse accessors, which are not read; export it without": any(
            "sparse" in accessor for accessor in header.get("accessors", [])
        ),
    }


def decode_normalized(header: JsonObject, index: int, values: AnyArray) -> Float64Array:
    """Return the values of an accessor as floats: normalised integers become shares of 1.

    Parameters
    ----------
    header : JSON of the file.
    index : index of the accessor.
    values : numbers as stored.
    """
    accessor = header["accessors"][index]
    numbers = np.asarray(values, np.float64)
    if not accessor.get("normalized") or accessor["componentType"] not in _MAX_COMPONENT:
        return numbers
    return np.maximum(numbers / _MAX_COMPONENT[accessor["componentType"]], -1.0)


def base_colour_texture(header: JsonObject, material: JsonObject) -> BaseColourTexture | None:
    """Return the base colour texture of a material, else that of its light, into which programs bake; None without one."""
    info = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
    if info is None:
        info = material.get("extensions", {}).get(_SPECULAR_GLOSSINESS, {}).get("diffuseTexture")
    if info is None:
        info = material.get("emissiveTexture")
    if info is None or "index" not in info:
        return None
    texture = header_item(header, "textures", info["index"])
    sources = [texture.get("extensions", {}).get(name, {}).get("source") for name in _PICTURE_EXTENSIONS]
    source = next((one for one in sources if one is not None), texture.get("source"))
    uri = str(header_item(header, "images", source).get("uri", ""))
    stated = info.get("extensions", {}).get(TEXTURE_TRANSFORM, {})
    coordinate_set = stated.get("texCoord", info.get("texCoord", 0))
    sampler = header_item(header, "samplers", texture.get("sampler"))
    repeats = all(sampler.get(axis, _REPEAT) == _REPEAT for axis in ("wrapS", "wrapT"))
    return BaseColourTexture(
        "" if uri.startswith("data:") else uri, int(coordinate_set), _uv_transform(stated), repeats
    )


def exceeds_picture(uv: Float64Array) -> bool:
    """Return True where texture coordinates (n, 2) leave their picture."""
    return bool(len(uv)) and bool(uv.min() < -MODELS.max_texture_excess or uv.max() > 1.0 + MODELS.max_texture_excess)


def stated_frame(header: JsonObject) -> str | None:
    """Return the frame that the extras of the file, its scene or its first nodes name; None without one."""
    scene = header_item(header, "scenes", header.get("scene", 0))
    nodes = [header_item(header, "nodes", index) for index in scene.get("nodes", [])[:1]]
    for item in (scene, header, header.get("asset", {}), *nodes):
        extras = item.get("extras")
        for key, value in extras.items() if isinstance(extras, dict) else ():
            if key.lower() in _FRAME_KEYS and (found := _EPSG_CODE.search(str(value))):
                return f"EPSG:{found[1]}"
    return None


def base_colour(material: JsonObject) -> Colour | None:
    """Return the base colour of a material in sRGB; None where it states none or the default, white."""
    stated = material.get("pbrMetallicRoughness", {}).get("baseColorFactor")
    if stated is None:
        stated = material.get("extensions", {}).get(_SPECULAR_GLOSSINESS, {}).get("diffuseFactor")
    colour = parse_colour_shares(stated, is_linear=True)
    return None if colour == _WHITE else colour


def _uv_transform(stated: JsonObject) -> Float64Array:
    """Return the matrix (2, 3) of KHR_texture_transform: scale, then counter-clockwise rotation, then offset."""
    cos, sin = math.cos(float(stated.get("rotation", 0.0))), math.sin(float(stated.get("rotation", 0.0)))
    turned = np.array([[cos, sin], [-sin, cos]]) @ np.diag(np.asarray(stated.get("scale", (1.0, 1.0)), np.float64))
    return np.column_stack([turned, np.asarray(stated.get("offset", (0.0, 0.0)), np.float64)])


def header_item(header: JsonObject, kind: str, index: int | None) -> JsonObject:
    """Return an item of a list of the header, empty where it is missing."""
    items = header.get(kind, [])
    return items[index] if index is not None and 0 <= index < len(items) else {}
