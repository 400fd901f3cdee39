"""Colours of materials without a picture, as the finish of a building."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import itemgetter

import numpy as np

from catalogs.features import Remark
from catalogs.readers.settings import MODELS
from catalogs.readers.vectors.colours import Colour
from facade_core.core.arrays import Float64Array
from facade_core.core.linear_light import linear_to_srgb
from facade_core.core.types import PLAIN, BuildingFinish

SEVERAL_COLOURS_REASON = "buildings with several colours of materials, read in that of the largest area"


def choose_finish(faces: Iterable[tuple[str, Float64Array, Colour]], id: str, remarks: list[Remark]) -> BuildingFinish:
    """Return the colours that cover most of the walls and most of the roof.

    Parameters
    ----------
    faces : semantic, normals (n, 3) as long as their areas and colour; "unknown" goes by the normal.
    id : building of the remark.
    remarks : receives a remark where walls or roof have several colours.
    """
    areas: dict[str, dict[Colour, float]] = {"wall": {}, "roof": {}}
    for semantic, normals, colour in faces:
        sizes = np.linalg.norm(normals, axis=1)
        if semantic == "unknown":
            is_level = np.abs(normals[:, 2]) > MODELS.max_wall_slope * sizes
            parts = {"roof": float(sizes[is_level].sum()), "wall": float(sizes[~is_level].sum())}
        else:
            parts = {semantic: float(sizes.sum())}
        for kind in areas.keys() & parts.keys():
            if parts[kind] > 0:
                areas[kind][colour] = areas[kind].get(colour, 0.0) + parts[kind]
    if any(len(found) > 1 for found in areas.values()):
        remarks.append(Remark(id, SEVERAL_COLOURS_REASON, None))
    chosen = {kind: max(found.items(), key=itemgetter(1))[0] for kind, found in areas.items() if found}
    return BuildingFinish(chosen.get("wall"), chosen.get("roof")) if chosen else PLAIN


def parse_colour_shares(values: object, *, is_linear: bool = False) -> Colour | None:
    """Return RGB of three or more numbers from 0 to 1, None of anything else.

    Parameters
    ----------
    values : list of numbers; further ones, such as an opacity, are ignored.
    is_linear : True for linear light, which becomes sRGB.
    """
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) < 3:
        return None
    if not all(isinstance(value, int | float) and 0.0 <= value <= 1.0 for value in values[:3]):
        return None
    shares = np.array(values[:3], np.float64)
    red, green, blue = (linear_to_srgb(shares) if is_linear else np.rint(255 * shares).astype(np.uint8)).tolist()
    return red, green, blue
