"""Photo textures of CityGML: which picture lies on a ring, and where on the picture its corners are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import Remark
from catalogs.readers.beside import OUTSIDE_FOLDER_REASON, find_referenced_file, is_outside_folder, filename_variants
from catalogs.readers.citygml.stream import parse_numbers

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


@dataclass(slots=True)
class CityGmlAppearance:
    """The textures of a file.

    targets: ring id -> (rank of its theme, picture, texture coordinates as text); pictures: by the URI as written, None where
    there is none; used: pictures that faces show -> their indices; matrices: surfaces textured by a matrix.
    """

    path: Path
    targets: dict[str, tuple[tuple[bool, str], Path, str]] = field(default_factory=dict)
    pictures: dict[str, Path | None] = field(default_factory=dict)
    used: dict[Path, int] = field(default_factory=dict)
    matrices: int = 0


def add_parameterized_texture(texture: Element, appearance: CityGmlAppearance) -> None:
    """Enter a ParameterizedTexture; a ring that has one keeps that of the theme rgbTexture, else of the first by name."""
    appearance.matrices += sum(1 for _ in texture.iter("{*}TexCoordGen"))
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
            if name not in appearance.targets or rank < appearance.targets[name][0]:
                appearance.targets[name] = (rank, picture, text.text or "")


def face_texture(rings: Mapping[str, np.ndarray], appearance: CityGmlAppearance) -> tuple[int | None, list[np.ndarray] | None]:
    """A face's texture (-1 without, None where its coordinates do not fit) and its coordinates by ring, (n, 2) each.

    rings: by id, the outer one first, (n, 3) each without the closing point.
    """
    targets = [appearance.targets.get(ring) for ring in rings]
    if targets[0] is None:
        return -1, None
    picture, uv = targets[0][1], []
    for ring, target in zip(rings.values(), targets, strict=True):
        numbers = parse_numbers(target[2]) if target and target[1] == picture else []
        if len(numbers) // 2 - len(ring) not in (0, 1) or not np.isfinite(numbers).all():
            return None, None
        uv.append(np.array(numbers[: 2 * len(ring)]).reshape(-1, 2))
    return appearance.used.setdefault(picture, len(appearance.used)), uv


def appearance_remarks(appearance: CityGmlAppearance) -> list[Remark]:
    """What is said of a file whose textures are all entered."""
    file, remarks = appearance.path.name, []
    missing = [uri for uri, picture in appearance.pictures.items() if picture is None]
    if missing:
        text = f"{len(missing)} of {len(appearance.pictures)} of {file}, the first {missing[0]}"
        remarks.append(Remark(text, "texture pictures that are not there, surfaces left untextured", None))
    remarks += [Remark(uri, OUTSIDE_FOLDER_REASON, None) for uri in missing if is_outside_folder(appearance.path, *filename_variants(uri))]
    if appearance.matrices:
        text = f"{appearance.matrices} of {file}"
        remarks.append(Remark(text, "textures placed by a matrix instead of coordinates ignored", None))
    return remarks
