"""Pictures of materials: of the roofs, and a folder of others, each named after its material."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import NamedTuple

from catalogs.file_digest import file_digest
from catalogs.readers.pictures.decoding import open_picture
from catalogs.readers.pictures.folders import list_images
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.types import MATERIALS

# NAME.jpg, or NAME-1.5m.jpg for a picture of that width.
_FILE_NAME = re.compile(r"(.+?)(?:-(\d+(?:\.\d+)?)m)?")


class MaterialPicture(NamedTuple):
    """Picture of a material of `MATERIALS` and its width in metres."""

    name: str
    path: Path
    metres: float

    def digest_content(self) -> tuple[str, float, str]:
        """Return what tells the picture from others: not its path."""
        return self.name, self.metres, file_digest(self.path)


class RoofPicture(NamedTuple):
    """Picture of the roof material, and its metres per pixel."""

    path: Path
    metres_per_pixel: float

    def digest_content(self) -> tuple[str, float]:
        """Return what tells the picture from others: not its path."""
        return file_digest(self.path), self.metres_per_pixel


def read_material_pictures(folder: Path) -> tuple[MaterialPicture, ...]:
    """Return the pictures of a folder in the order of MATERIALS, at most one each.

    Raises
    ------
    InputError
        Where a picture has another name, an impossible width, cannot be tiled or cannot be used.
    """
    paths, faults = list_images(folder, "material")
    if faults:
        raise InputError(f"{folder}: {faults[0].reason}")
    found: dict[str, MaterialPicture] = {}
    for path in paths:
        picture = _parse_picture(folder, path)
        if picture.name in found:
            raise InputError(
                f"{folder}: {found[picture.name].path.name} and {path.name} both show {picture.name}; remove one"
            )
        found[picture.name] = picture
    return tuple(found[name] for name in MATERIALS if name in found)


def _parse_picture(folder: Path, path: Path) -> MaterialPicture:
    match = _FILE_NAME.fullmatch(path.stem)
    name, width_text = (match[1], match[2]) if match else (path.stem, None)
    if name not in MATERIALS:
        close = difflib.get_close_matches(name, MATERIALS, n=1)
        remedy = f"did you mean {close[0]}?" if close else f"rename it to one of {', '.join(MATERIALS)}, or remove it"
        raise InputError(f"{folder}: {path.name} names no material that is known; {remedy}")
    metres = float(width_text) if width_text else PICTURES.default_material_width_m
    if not PICTURES.material_width_range_m[0] <= metres <= PICTURES.material_width_range_m[1]:
        low, high = PICTURES.material_width_range_m
        raise InputError(
            f"{folder}: {path.name} says {width_text} m; a picture is {low:g} to {high:g} m wide, rename it"
        )
    with open_picture(path) as image:
        width, height = image.size
    if abs(width / height - max(1, round(width / height))) > PICTURES.max_material_aspect_error:
        raise InputError(
            f"{folder}: {path.name} is {width} x {height} pixels and cannot be laid; "
            "give one that goes on into itself, as wide as high or twice, three times, ... as wide"
        )
    return MaterialPicture(name, path.absolute(), metres)
