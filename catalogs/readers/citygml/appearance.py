"""Photo textures of CityGML: the picture of each ring and its texture coordinates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import Remark
from catalogs.readers.citygml.stream import gml_id, parse_numbers
from catalogs.readers.referenced_files import find_referenced_file, unread_file_reason
from catalogs.readers.settings import MODELS
from catalogs.readers.vectors.colours import Colour
from facade_core.core.arrays import Float64Array

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


# Values of wrapMode by which a picture does not repeat.
_ENDING_WRAP_MODES = frozenset(("none", "clamp", "border", "mirror"))


@dataclass(slots=True)
class CityGmlAppearance:
    """Textures of a file.

    Attributes
    ----------
    path : CityGML file.
    ring_textures : (rank of the theme, picture, texture coordinates as text) by ring id.
    pictures : file by URI as written, None where it is missing.
    texture_indices : index of each picture that faces use.
    matrix_count : number of surfaces textured by a matrix.
    georeferenced_count : number of georeferenced textures.
    unwrapped_count : number of textures whose picture ends inside a surface instead of repeating.
    matched_count : number of faces of buildings that have texture coordinates.
    colours : (rank of the theme, diffuse colour) of X3DMaterials by the id of their targets.
    """

    path: Path
    ring_textures: dict[str, tuple[tuple[bool, str], Path, str]] = field(default_factory=dict)
    pictures: dict[str, Path | None] = field(default_factory=dict)
    texture_indices: dict[Path, int] = field(default_factory=dict)
    matrix_count: int = 0
    georeferenced_count: int = 0
    unwrapped_count: int = 0
    matched_count: int = 0
    colours: dict[str, tuple[tuple[bool, str], Colour]] = field(default_factory=dict)


def add_parameterized_texture(texture: Element, appearance: CityGmlAppearance) -> None:
    """Add a ParameterizedTexture.

    Rings prefer the theme rgbTexture, else the first theme by name.
    """
    appearance.matrix_count += len(list(texture.iter("{*}TexCoordGen")))
    uri = texture.findtext("{*}imageURI", "").strip()
    if uri not in appearance.pictures:
        appearance.pictures[uri] = find_referenced_file(appearance.path, uri)
    picture = appearance.pictures[uri]
    if picture is None:
        return
    rank = _theme_rank(texture)
    wrap_mode = texture.findtext("{*}wrapMode", "").strip().lower()
    if wrap_mode in _ENDING_WRAP_MODES and any(map(_exceeds_picture, texture.iter("{*}textureCoordinates"))):
        appearance.unwrapped_count += 1
    for ring, text in _coordinates_by_ring(texture):
        name, entry = ring.strip().rpartition("#")[2], (rank, picture, text)
        appearance.ring_textures[name] = min(appearance.ring_textures.get(name, entry), entry, key=itemgetter(0))


def _coordinates_by_ring(texture: Element) -> Iterator[tuple[str, str]]:
    for coordinates in texture.iter("{*}TexCoordList"):
        texts = coordinates.findall("{*}textureCoordinates")
        rings = [text.get("ring") for text in texts]
        if None in rings:  # CityGML 3.0 lists the rings after the coordinates
            rings = [ring.text for ring in coordinates.findall("{*}ring")]
        yield from ((ring or "", text.text or "") for ring, text in zip(rings, texts, strict=False))


def add_material(material: Element, appearance: CityGmlAppearance) -> None:
    """Add the diffuse colour of an X3DMaterial to its targets."""
    stated = parse_numbers(material.findtext("{*}diffuseColor") or "0.8 0.8 0.8")  # default of X3D
    if len(stated) != 3 or not all(0.0 <= value <= 1.0 for value in stated):
        return
    red, green, blue = (round(255 * value) for value in stated)
    rank = _theme_rank(material)
    for target in material.iterfind("{*}target"):
        name = ((target.text or "").strip() or target.get("{http://www.w3.org/1999/xlink}href", "")).rpartition("#")[2]
        entry = (rank, (red, green, blue))
        appearance.colours[name] = min(appearance.colours.get(name, entry), entry, key=itemgetter(0))


def surface_colour(polygon: Element, appearance: CityGmlAppearance) -> Colour | None:
    """Return the colour of the material of a polygon, or of the surface or geometry that contains it."""
    if not appearance.colours:
        return None
    holders = (polygon, *polygon.iterancestors())
    return next((appearance.colours[id][1] for one in holders if (id := gml_id(one)) in appearance.colours), None)


def _theme_rank(data: Element) -> tuple[bool, str]:
    """Return the rank of the theme of surface data: rgbTexture first, else by name."""
    holder = next(data.iterancestors("{*}Appearance"), None)
    theme = "" if holder is None else holder.findtext("{*}theme", "").strip()
    return theme.casefold() != "rgbtexture", theme


def _exceeds_picture(coordinates: Element) -> bool:
    numbers = parse_numbers(coordinates.text)
    return bool(numbers) and (
        min(numbers) < -MODELS.max_texture_excess or max(numbers) > 1.0 + MODELS.max_texture_excess
    )


def face_texture(
    rings: Mapping[str, Float64Array], appearance: CityGmlAppearance
) -> tuple[int | None, list[Float64Array] | None]:
    """Return the texture index of a face and the coordinates (n, 2) of each ring.

    Parameters
    ----------
    rings : (n, 3) vertices by ring id without the closing point, the outer ring first.
    appearance : textures of the file; a new picture gets an index.

    Returns
    -------
    index : -1 without a texture, None where the coordinates do not fit.
    uv : coordinates by ring, or None.
    """
    targets = [appearance.ring_textures.get(ring) for ring in rings]
    if targets[0] is None:
        return -1, None
    appearance.matched_count += 1
    picture, uv = targets[0][1], []
    for ring, target in zip(rings.values(), targets, strict=True):
        numbers = parse_numbers(target[2]) if target and target[1] == picture else []
        if len(numbers) // 2 - len(ring) not in (0, 1) or not np.isfinite(numbers).all():
            return None, None
        uv.append(np.array(numbers[: 2 * len(ring)]).reshape(-1, 2))
    return appearance.texture_indices.setdefault(picture, len(appearance.texture_indices)), uv


def appearance_remarks(appearance: CityGmlAppearance) -> list[Remark]:
    """Return the remarks on a file after all its textures were added."""
    file = appearance.path.name
    reasons = {
        uri: unread_file_reason(appearance.path, uri) for uri, picture in appearance.pictures.items() if picture is None
    }
    remarks = [Remark(uri, reason, None) for uri, reason in reasons.items() if reason]
    if absent := [uri for uri, reason in reasons.items() if not reason]:
        text = f"{len(absent)} of {len(appearance.pictures)} of {file}, the first {absent[0]}"
        remarks.append(Remark(text, "texture pictures that are not there, surfaces left untextured", None))
    counts = {
        "textures placed by a matrix instead of coordinates ignored": appearance.matrix_count,
        "georeferenced textures ignored; give the picture as imagery.aerial": appearance.georeferenced_count,
        "textures whose wrapMode ends the picture inside a surface: repeated there": appearance.unwrapped_count,
    }
    return remarks + [Remark(f"{count} of {file}", reason, None) for reason, count in counts.items() if count]
