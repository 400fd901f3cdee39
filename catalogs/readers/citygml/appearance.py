"""Photo textures of CityGML: the picture of each ring and its texture coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import Remark
from catalogs.readers.citygml.stream import parse_numbers
from catalogs.readers.referenced_files import (
    OUTSIDE_FOLDER_REASON,
    filename_variants,
    find_referenced_file,
    is_outside_folder,
)
from facade_core.core.arrays import Float64Array

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


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
    """

    path: Path
    ring_textures: dict[str, tuple[tuple[bool, str], Path, str]] = field(default_factory=dict)
    pictures: dict[str, Path | None] = field(default_factory=dict)
    texture_indices: dict[Path, int] = field(default_factory=dict)
    matrix_count: int = 0


def add_parameterized_texture(texture: Element, appearance: CityGmlAppearance) -> None:
    """Add a ParameterizedTexture.

    Rings prefer the theme rgbTexture, else the first theme by name.
    """
    appearance.matrix_count += sum(1 for _ in texture.iter("{*}TexCoordGen"))
    uri = (texture.findtext("{*}imageURI") or "").strip()
    if uri not in appearance.pictures:
        appearance.pictures[uri] = find_referenced_file(appearance.path, *filename_variants(uri))
    picture = appearance.pictures[uri]
    if picture is None:
        return
    holder = next(texture.iterancestors("{*}Appearance"), None)
    theme = "" if holder is None else (holder.findtext("{*}theme") or "").strip()
    rank = (theme.casefold() != "rgbtexture", theme)
    for coordinates in texture.iter("{*}TexCoordList"):
        texts = coordinates.findall("{*}textureCoordinates")
        rings = [text.get("ring") for text in texts]
        if None in rings:  # CityGML 3.0 lists the rings after the coordinates
            rings = [ring.text for ring in coordinates.findall("{*}ring")]
        for ring, text in zip(rings, texts, strict=False):
            name = (ring or "").strip().rpartition("#")[2]
            if name not in appearance.ring_textures or rank < appearance.ring_textures[name][0]:
                appearance.ring_textures[name] = (rank, picture, text.text or "")


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
    picture, uv = targets[0][1], []
    for ring, target in zip(rings.values(), targets, strict=True):
        numbers = parse_numbers(target[2]) if target and target[1] == picture else []
        if len(numbers) // 2 - len(ring) not in (0, 1) or not np.isfinite(numbers).all():
            return None, None
        uv.append(np.array(numbers[: 2 * len(ring)]).reshape(-1, 2))
    return appearance.texture_indices.setdefault(picture, len(appearance.texture_indices)), uv


def appearance_remarks(appearance: CityGmlAppearance) -> list[Remark]:
    """Return the remarks on a file after all its textures were added."""
    file, remarks = appearance.path.name, []
    missing = [uri for uri, picture in appearance.pictures.items() if picture is None]
    if missing:
        text = f"{len(missing)} of {len(appearance.pictures)} of {file}, the first {missing[0]}"
        remarks.append(Remark(text, "texture pictures that are not there, surfaces left untextured", None))
    remarks += [
        Remark(uri, OUTSIDE_FOLDER_REASON, None)
        for uri in missing
        if is_outside_folder(appearance.path, *filename_variants(uri))
    ]
    if appearance.matrix_count:
        text = f"{appearance.matrix_count} of {file}"
        remarks.append(Remark(text, "textures placed by a matrix instead of coordinates ignored", None))
    return remarks
