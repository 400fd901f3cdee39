"""Library of an exemplar or photo: element types with a picture each, grains and mouldings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, FloatArray, Int64Array, IntArray, UInt8Array
from facade_core.core.linear_light import linear_to_srgb, smooth_known_light, srgb_to_linear
from facade_core.core.types import Element
from facade_core.export.bodies.mouldings import WallBand, free_wall_mask, split_wall_into_bands
from facade_core.export.factored.image_quilting import WallGrain, synthesise_grain
from facade_core.export.factored.settings import LIBRARIES
from facade_core.export.factored.units import FacadeUnit, Rectangle, group_elements_into_units, surround_reach
from facade_core.facade.variation.encoding import encode


@dataclass(frozen=True, eq=False)
class ElementTypePicture:
    """Picture that represents a type of elements, with its scale and light.

    Attributes
    ----------
    kind : label of the element.
    picture : (h, w, 3) uint8, with its surround.
    box : the element in the picture, pixels.
    panes : recessed parts, pixels.
    wall_light : (3,) linear light of the wall around it.
    pixels_per_metre : resolution of the picture.
    """

    kind: str
    picture: UInt8Array
    box: Rectangle
    panes: tuple[Rectangle, ...]
    wall_light: Float32Array
    pixels_per_metre: float


@dataclass(frozen=True, eq=False)
class MouldingTexture:
    """Texture of a moulding that tiles horizontally.

    Attributes
    ----------
    picture : (h, w, 3) uint8.
    width_m : width on the wall, metres.
    colour : (3,) mean linear light.
    """

    picture: UInt8Array
    width_m: float
    colour: Float32Array


@dataclass(frozen=True, eq=False)
class FacadeLibrary:
    """Units, element types, grains and mouldings of one picture.

    Attributes
    ----------
    units : units of the picture.
    unit_types : (levels, units) type of each unit at each level of the variations.
    descriptors : (units, s, s, 3) `unit_descriptor` of each unit.
    wall_light : (units, 3) linear light of the wall around each unit.
    types : types by number.
    bands : bands of the wall.
    grains : grain of each band that is no moulding.
    mouldings : texture of each moulding.
    """

    units: tuple[FacadeUnit, ...]
    unit_types: Int64Array
    descriptors: Float32Array
    wall_light: FloatArray
    types: dict[int, ElementTypePicture]
    bands: tuple[WallBand, ...]
    grains: dict[int, WallGrain]
    mouldings: dict[int, MouldingTexture]

    def find_similar_unit(self, unit: FacadeUnit, look: Float32Array, wall: FloatArray) -> int | None:
        """Find the most similar unit of the same kind; None if there is none.

        Parameters
        ----------
        unit : the unit to match.
        look : its descriptor.
        wall : (3,) linear light of the wall around it.
        """
        wide, high = unit.size
        best: tuple[float, int] | None = None
        for k, own in enumerate(self.units):
            ratio = abs(float(np.log((wide / high) / (own.size[0] / own.size[1]))))
            if own.kind != unit.kind or ratio > np.log(LIBRARIES.max_aspect_ratio):
                continue
            off = float(np.abs(np.sqrt(wall) - np.sqrt(self.wall_light[k])).mean())
            apart = float(np.abs(look - self.descriptors[k]).mean()) + 20 * ratio + LIBRARIES.wall_light_weight * off
            if best is None or apart < best[0]:
                best = apart, k
        return None if best is None else best[1]

    def unit_type(self, unit: int, level: int) -> int:
        """Return the type of a unit at a level, or at the last level."""
        return int(self.unit_types[min(level, len(self.unit_types) - 1), unit])


def unit_descriptor(image: UInt8Array, box: Rectangle, density: float) -> Float32Array:
    """Compute the descriptor of a box: a thumbnail with half of its mean light removed.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    box : x0, y0, x1, y1 in metres.
    density : pixels per metre.

    Returns
    -------
    (s, s, 3) float32.
    """
    import cv2

    x0, y0, x1, y1 = (round(side * density) for side in box)
    part = image[max(0, y0) : max(y1, y0 + 1), max(0, x0) : max(x1, x0 + 1)]
    if not part.size:
        return np.zeros((LIBRARIES.descriptor_side_px, LIBRARIES.descriptor_side_px, 3), np.float32)
    small = cv2.resize(
        part, (LIBRARIES.descriptor_side_px, LIBRARIES.descriptor_side_px), interpolation=cv2.INTER_AREA
    ).astype(np.float32)
    descriptor: Float32Array = small - 0.5 * small.mean()
    return descriptor


def mean_light(light: Float32Array, box: Rectangle, density: float) -> Float32Array:
    """Return the mean (3,) of light (h, w, 3) over a box in metres."""
    height, width = light.shape[:2]
    x0, y0, x1, y1 = (round(side * density) for side in box)
    left, top = min(max(x0, 0), width - 1), min(max(y0, 0), height - 1)
    mean: Float32Array = light[top : max(y1, top + 1), left : max(x1, left + 1)].mean(axis=(0, 1))
    return mean


def _expand_box(box: Rectangle) -> Rectangle:
    return (
        box[0] - LIBRARIES.wall_smoothing_m,
        box[1] - LIBRARIES.wall_smoothing_m,
        box[2] + LIBRARIES.wall_smoothing_m,
        box[3] + LIBRARIES.wall_smoothing_m,
    )


def surrounding_wall_light(light: Float32Array, box: Rectangle, density: float) -> Float32Array:
    """Return the light (3,) of the wall around a box, from the wall light (h, w, 3)."""
    return mean_light(light, _expand_box(box), density)


def build_library(
    image: UInt8Array,
    labels: UInt8Array,
    elements: Sequence[Element],
    density: float,
    fine: UInt8Array | None = None,
    *,
    seed: int,
) -> FacadeLibrary:
    """Build the library of a picture.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) facade classes.
    elements : elements in pixels.
    density : pixels per metre.
    fine : the same picture with more pixels, from which textures are taken.
    seed : random seed of the grains.
    """
    units = group_elements_into_units(elements, density)
    fine = image if fine is None else fine
    times = fine.shape[0] / image.shape[0]
    whole = density * times
    free = free_wall_mask(labels, [unit.box for unit in units], density)
    bands = split_wall_into_bands(image, free, density)
    import cv2

    free_fine = cv2.resize(free.astype(np.uint8), fine.shape[1::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
    wall = smooth_known_light(srgb_to_linear(image), free, LIBRARIES.wall_smoothing_m * density)
    reach = _surround_reaches(image, units, linear_to_srgb(wall).astype(np.float32), density)
    walls = np.array([surrounding_wall_light(wall, unit.box, density) for unit in units]).reshape(-1, 3)
    of, chosen = _assign_types(image, units, walls, density)
    return FacadeLibrary(
        tuple(units),
        of,
        np.stack([unit_descriptor(image, unit.box, density) for unit in units])
        if units
        else np.zeros((0, LIBRARIES.descriptor_side_px, LIBRARIES.descriptor_side_px, 3), np.float32),
        walls,
        {t: _make_type(fine, units[k], reach[k], whole, wall, density) for t, k in chosen.items()},
        tuple(bands),
        _synthesise_grains(fine, free_fine, bands, whole, seed),
        {number: _make_moulding(fine, free_fine, band, whole) for number, band in enumerate(bands) if band.is_moulding},
    )


def _synthesise_grains(
    fine: UInt8Array, free: BoolArray, bands: Sequence[WallBand], density: float, seed: int
) -> dict[int, WallGrain]:
    """Synthesise the grain of every band that is no moulding; bands of nearly one colour share it."""
    plain = [number for number, band in enumerate(bands) if not band.is_moulding]
    found: dict[int, WallGrain] = {}
    for group in _group_by_colour(plain, [band.colour for band in bands]):
        area = np.logical_or.reduce([_band_mask(free, bands[number], density) for number in group])
        grain = synthesise_grain(fine, area, density, seed)
        found |= dict.fromkeys(group, grain)
    return found


def _group_by_colour(members: Sequence[int], colours: Sequence[FloatArray] | FloatArray) -> list[list[int]]:
    """Group members of nearly the colour of a group's first member, linear light (3,) each."""
    groups: list[list[int]] = []
    for member in members:
        root = np.sqrt(colours[member])
        for group in groups:
            if np.abs(root - np.sqrt(colours[group[0]])).max() < LIBRARIES.max_material_difference:
                group.append(member)
                break
        else:
            groups.append([member])
    return groups


def _band_mask(free: BoolArray, band: WallBand, density: float) -> BoolArray:
    top, foot = round(band.top * density), round(band.foot * density)
    found = np.zeros_like(free)
    # the edges of a band belong to its neighbours
    rim = min(round(0.06 * density), (foot - top) // 4)
    found[top + rim : foot - rim] = free[top + rim : foot - rim]
    return found


def _surround_reaches(
    image: UInt8Array, units: Sequence[FacadeUnit], wall: Float32Array, density: float
) -> list[tuple[float, float, float, float]]:
    """Return the reach of each unit's surround."""
    number = np.full(image.shape[:2], -1)
    for k, unit in enumerate(units):
        x0, y0, x1, y1 = (max(0, round(side * density)) for side in unit.box)
        number[y0:y1, x0:x1] = k
    found = np.array(
        [surround_reach(image, (number >= 0) & (number != k), wall, unit.box, density) for k, unit in enumerate(units)]
    ).reshape(-1, 4)
    return [tuple(row) for row in found.tolist()]


def _assign_types(
    image: UInt8Array, units: Sequence[FacadeUnit], walls: FloatArray, density: float
) -> tuple[Int64Array, dict[int, int]]:
    """Return the type of every unit at every level (levels, units), and the representative unit of each type.

    Units in walls of different materials have different types, because their surrounds differ.
    """
    if not units:
        return np.zeros((1, 0), np.int64), {}
    groups = _group_by_colour(list(range(len(units))), walls)
    of = [_assign_material_types(image, [units[k] for k in group], density) for group in groups]
    levels = np.zeros((max(len(own) for own, _ in of), len(units)), np.int64)
    chosen: dict[int, int] = {}
    before = 0
    for group, (own, representatives) in zip(groups, of, strict=True):
        # a group with fewer levels keeps its last one
        levels[:, group] = before + own[np.minimum(np.arange(len(levels)), len(own) - 1)]
        chosen |= {before + t: group[k] for t, k in representatives.items()}
        before = max(chosen) + 1
    return levels, chosen


def _assign_material_types(
    image: UInt8Array, units: Sequence[FacadeUnit], density: float
) -> tuple[Int64Array, dict[int, int]]:
    """Return types and representatives of units in walls of one material."""
    own = np.rint(np.array([unit.box for unit in units]) * density).astype(int)
    hierarchy = encode(image, [Element(unit.kind, *box) for unit, box in zip(units, own.tolist(), strict=True)])
    boxes = np.concatenate([np.zeros((0, 4)), *(np.reshape(group.boxes, (-1, 4)) for group in hierarchy.groups)])
    if not len(boxes):  # all elements are too small to be coded
        return np.arange(len(units))[None], {k: k for k in range(len(units))}
    # coded elements may have moved by a few pixels; elements that are too small are not coded
    nearest = _nearest_boxes(own, boxes)
    levels = np.stack([hierarchy.types_at(level)[nearest] for level in range(len(hierarchy.levels))])
    back = dict(zip(nearest[::-1].tolist(), range(len(nearest))[::-1], strict=True))
    chosen = {t: back[int(e)] for t, e in enumerate(hierarchy.representatives) if int(e) in back}
    for t in np.unique(levels).tolist():  # type without a representative among the units
        chosen.setdefault(t, int(np.argwhere(levels == t)[0, 1]))
    return levels.astype(np.int64), chosen


def _nearest_boxes(own: IntArray, others: Float64Array) -> Int64Array:
    """Return, for each box (n, 4), the index (n,) of the other box (k, 4) with the nearest middle."""
    own_middle, other_middle = ((boxes[:, :2] + boxes[:, 2:]) / 2 for boxes in (own, others))
    nearest: Int64Array = np.linalg.norm(own_middle[:, None] - other_middle[None], axis=2).argmin(axis=1)
    return nearest


def _make_type(
    fine: UInt8Array,
    unit: FacadeUnit,
    reach: tuple[float, float, float, float],
    density: float,
    wall_light: Float32Array,
    coarse: float,
) -> ElementTypePicture:
    height, width = fine.shape[:2]
    x0, y0, x1, y1 = (side * density for side in unit.box)
    left, top = max(0, round(x0 - reach[0] * density)), max(0, round(y0 - reach[1] * density))
    right, foot = min(width, round(x1 + reach[2] * density)), min(height, round(y1 + reach[3] * density))
    return ElementTypePicture(
        unit.kind,
        fine[top:foot, left:right],
        (x0 - left, y0 - top, x1 - left, y1 - top),
        tuple(
            (a * density - left, b * density - top, c * density - left, d * density - top) for a, b, c, d in unit.panes
        ),
        mean_light(wall_light, (left / density, top / density, right / density, foot / density), coarse),
        density,
    )


def _make_moulding(fine: UInt8Array, free: BoolArray, band: WallBand, density: float) -> MouldingTexture:
    """Cut the longest free run of a band and blend its end into its start."""
    top, foot = round(band.top * density), max(round(band.top * density) + 1, round(band.foot * density))
    clear = free[top:foot].mean(axis=0) > 0.98
    edges = np.flatnonzero(np.diff(np.pad(clear.astype(np.int8), 1)))
    runs = edges.reshape(-1, 2)
    start, stop = max(runs.tolist(), key=lambda run: run[1] - run[0], default=[0, 0])
    fade = round(LIBRARIES.fade_m * density)
    stop = min(stop, start + round(LIBRARIES.max_moulding_m * density) + fade)
    rows = fine[top:foot]
    if stop - start < LIBRARIES.min_moulding_m * density + fade:
        means = [
            srgb_to_linear(row[own] if own.any() else row).mean(axis=0)
            for row, own in zip(rows, free[top:foot], strict=True)
        ]
        column = linear_to_srgb(np.stack(means))
        picture = np.repeat(column[:, None], max(8, round(LIBRARIES.min_moulding_m * density)), axis=1)
    else:
        light = srgb_to_linear(rows[:, start:stop])
        share = ((np.arange(fade) + 0.5) / fade)[None, :, None]
        long = light[:, :-fade].copy()
        long[:, :fade] = share * light[:, :fade] + (1 - share) * light[:, -fade:]
        picture = linear_to_srgb(long)
    return MouldingTexture(picture, picture.shape[1] / density, srgb_to_linear(picture).mean(axis=(0, 1)))
