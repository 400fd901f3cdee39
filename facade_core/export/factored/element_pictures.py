"""Elements of walls with the pixels of their exemplar: flat pictures in front of the wall's own texels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from facade_core.core.arrays import Float32Array, Float64Array, UInt8Array
from facade_core.core.linear_light import srgb_to_linear
from facade_core.core.types import Element
from facade_core.export.factored.library import (
    DESCRIPTOR_SIDE_PX,
    MAX_ASPECT_RATIO,
    ElementTypePicture,
    FacadeLibrary,
    unit_descriptor,
)
from facade_core.export.factored.units import FacadeUnit, group_elements_into_units
from facade_core.export.factored.wall_decomposition import StoredFacadeWall
from facade_core.export.factored.wall_geometry import TextureKey, WallPiece, WallPieces, WallPolygon
from facade_core.geometry.charts import Charts

# Distance of a picture from its wall, metres.
PICTURE_OFFSET_M = 0.01
# Maximum 99.5th percentile difference between an element of an original and its stored texels, grey levels.
MAX_GREY_DIFFERENCE = 4.0
# Minimum texel density of a picture relative to its wall.
MIN_DENSITY_GAIN = 1.25
# Maximum mean difference between a wall's element and the picture that replaces it, grey levels, and the side at which
# they are compared: a wall's texels are blurred, and its frames are displaced by up to a texel.
MAX_ELEMENT_DIFFERENCE = 12.0
COMPARED_SIDE_PX = 8
# Similar elements of an exemplar that are compared with one of a wall.
CANDIDATES = 4
# Largest distance between vertices that carry light, metres.
LIGHT_CELL_M = 0.8
# Smoothing of that light, metres.
LIGHT_SMOOTHING_M = 0.15
# Minimum and maximum factor on a picture.
LIGHT_LIMITS = (0.1, 3.0)


def collect_element_pictures(
    image: UInt8Array, fine: UInt8Array, elements: Sequence[Element], density: float
) -> FacadeLibrary:
    """Collect the elements of an exemplar whose stored texels are those of its original.

    An element differs where an occluder or a private area was replaced; it is left out. So is one whose original
    is hardly denser.

    Parameters
    ----------
    image : (h, w, 3) uint8 stored texels.
    fine : (H, W, 3) uint8 the original.
    elements : elements in stored texels.
    density : stored texels per metre.

    Returns
    -------
    A library with a type for each element, without surround, and neither bands nor grains.
    """
    from facade_core.core.resizing import resize_image

    difference = np.abs(resize_image(fine, image.shape[:2]).astype(np.int16) - image).mean(axis=2)
    times = fine.shape[0] / image.shape[0]
    units: list[FacadeUnit] = []
    types: dict[int, ElementTypePicture] = {}
    for unit in group_elements_into_units(elements, density) if times >= MIN_DENSITY_GAIN else ():
        x0, y0, x1, y1 = (max(0, round(side * density)) for side in unit.box)
        within = difference[y0:y1, x0:x1]
        if not within.size or float(np.percentile(within, 99.5)) > MAX_GREY_DIFFERENCE:
            continue
        left, top, right, foot = (round(side * times) for side in (x0, y0, x1, y1))
        picture = fine[top:foot, left:right]
        height, width = picture.shape[:2]
        light = srgb_to_linear(picture).mean(axis=(0, 1))
        types[len(units)] = ElementTypePicture(unit.kind, picture, (0, 0, width, height), (), light, density * times)
        units.append(unit)
    looks = [unit_descriptor(image, unit.box, density) for unit in units]
    return FacadeLibrary(
        tuple(units),
        np.arange(len(units))[None],
        np.stack(looks) if looks else np.zeros((0, DESCRIPTOR_SIDE_PX, DESCRIPTOR_SIDE_PX, 3), np.float32),
        np.array([types[k].wall_light for k in range(len(units))]).reshape(-1, 3),
        types,
        (),
        {},
        {},
    )


def place_element_pictures(
    facade: StoredFacadeWall,
    polygons: Sequence[WallPolygon],
    charts: Charts,
    library: FacadeLibrary,
    library_index: int,
    pieces: WallPieces,
) -> None:
    """Place the pictures of a library in front of the elements of a wall that show the same.

    The light on the wall is kept: every vertex has the ratio of the wall's smoothed light to that of its picture.

    Parameters
    ----------
    facade : the wall.
    polygons : polygons of the wall.
    charts : charts of the mesh.
    library : pictures of the wall's exemplar, from `collect_element_pictures`.
    library_index : number of the library.
    pieces : pieces of the building; changed in place.
    """
    density = facade.density
    taken: list[shapely.Polygon] = []
    units = group_elements_into_units(facade.elements, density)
    for unit in sorted(units, key=lambda one: (-one.size[0] * one.size[1], one.box)):
        x0, y0, x1, y1 = (max(0, round(side * density)) for side in unit.box)
        stored = facade.base_layer[y0:y1, x0:x1]
        if min(stored.shape[:2]) < 2:
            continue
        box = shapely.box(*(side / density for side in (x0, y0, x0 + stored.shape[1], y0 + stored.shape[0])))
        plane = next((one for one in polygons if one.outline.covers(box)), None)
        if plane is None or any(box.intersection(other).area > 1e-4 for other in taken):
            continue
        number = _find_same_element(library, unit, stored, unit_descriptor(facade.base_layer, unit.box, density))
        if number is None:
            continue
        picture = library.types[number].picture
        dense = picture.shape[0] / (stored.shape[0] / density)
        if dense < MIN_DENSITY_GAIN * density:
            continue
        taken.append(box)
        light = _relative_light(facade.colour[y0:y1, x0:x1], _reduce(picture, *stored.shape[:2]), density)
        key: TextureKey = ("type", library_index, number)
        pieces.add(key, _make_grid(plane, charts, facade.chart, box.bounds, light))
        pieces.elements.append((key, dense))


def _find_same_element(library: FacadeLibrary, unit: FacadeUnit, stored: UInt8Array, look: Float32Array) -> int | None:
    """Return the number of the library's element that a wall shows; None if it shows none of them."""
    ratio = np.log([one.size[0] / one.size[1] for one in library.units]) - np.log(unit.size[0] / unit.size[1])
    same_kind = np.array([one.kind == unit.kind for one in library.units], bool)
    candidates = np.flatnonzero(same_kind & (np.abs(ratio) < np.log(MAX_ASPECT_RATIO)))
    apart = np.abs(library.descriptors[candidates] - look).mean(axis=(1, 2, 3))
    tones = _reduce(stored, COMPARED_SIDE_PX, COMPARED_SIDE_PX).astype(np.int16)
    best: tuple[float, int] | None = None
    for number in candidates[np.argsort(apart, kind="stable")[:CANDIDATES]].tolist():
        shown = _reduce(library.types[number].picture, COMPARED_SIDE_PX, COMPARED_SIDE_PX)
        off = float(np.abs(shown - tones).mean())
        if off <= MAX_ELEMENT_DIFFERENCE and (best is None or off < best[0]):
            best = off, number
    return None if best is None else best[1]


def _reduce(picture: UInt8Array, height: int, width: int) -> UInt8Array:
    import cv2

    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _relative_light(colour: UInt8Array, shown: UInt8Array, density: float) -> Float32Array:
    """Return the light (h, w, 3) of a wall's texels relative to that of a picture, smoothed."""
    import cv2

    sigma = LIGHT_SMOOTHING_M * density
    wall, own = (
        cv2.GaussianBlur(srgb_to_linear(one), (0, 0), sigma, borderType=cv2.BORDER_REFLECT) for one in (colour, shown)
    )
    ratio: Float32Array = np.clip(wall / np.maximum(own, 1e-4), *LIGHT_LIMITS).astype(np.float32)
    return ratio


def _make_grid(
    plane: WallPolygon, charts: Charts, chart: int, bounds: tuple[float, float, float, float], light: Float32Array
) -> WallPiece:
    """Make a grid of triangles over a box of a wall, with light (h, w, 3) at its vertices."""
    import cv2

    x0, y0, x1, y1 = bounds
    shares = [np.linspace(0, 1, 1 + max(1, int(np.ceil(side / LIGHT_CELL_M)))) for side in (x1 - x0, y1 - y0)]
    place: Float64Array = np.stack(np.meshgrid(*shares), axis=-1).reshape(-1, 2)
    height, width = light.shape[:2]
    x, y = ((place * [width, height] - 0.5).astype(np.float32)).T
    remapped = cv2.remap(light, x[:, None], y[:, None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    factor = np.asarray(remapped, np.float32).reshape(-1, 3)
    wide = len(shares[0])
    corners = [
        (row * wide + column, row * wide + column + 1)
        for row in range(len(shares[1]) - 1)
        for column in range(wide - 1)
    ]
    triangles = [t for a, b in corners for t in ((a, a + wide, b), (b, a + wide, b + wide))]
    out = charts.normals()[chart]
    return WallPiece(
        plane.points(charts, chart, [x0, y0] + place * [x1 - x0, y1 - y0]) + PICTURE_OFFSET_M * out,
        np.tile(out, (len(place), 1)),
        place,
        factor,
        np.array(triangles),
        chart,
    )
