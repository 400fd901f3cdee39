"""Facade of a wall without imagery: retarget an exemplar's style."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.resizing import resize_image
from facade_core.core.types import Element
from facade_core.facade.facade import Facade, time_stage
from facade_core.facade.layout.scores import score
from facade_core.facade.layout.settings import MIN_PLAUSIBLE_SCORE
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.retargeting import ExemplarAnalysis
from facade_core.facade.texture.tint import tint_facade
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.facade.variation.encoding import encode_variations
from facade_core.facade.variation.photo_exchange import permute_photo_elements
from facade_core.facade.variation.variations import find_variations
from facade_core.facade.wall_material import lit_colour
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import count_floors
from facade_core.parsing.lattice import lattice

# Hierarchy level, as a share of the last one, within whose types a wall's elements are exchanged.
EXCHANGE_LEVEL = 0.75
# Other compositions of a street wall whose layout is implausible: bays more than fit best.
OTHER_BAYS = (1, -1)
# Pixels for each texel when a wall on no street is drawn, if the exemplar is that fine; drawn in texels it would be softer.
OVERSAMPLING = 2
# Largest factor by which a wall's bands are lightened or darkened; beyond it grain would dominate.
MAX_PAINT_FACTOR = 4.0
# Metres by which a wall extends behind a neighbour and beyond its edges.
FREE_MARGIN_M = 0.25


@dataclass(frozen=True)
class ScaledStyle:
    """Style of an exemplar at its scale.

    Attributes
    ----------
    style : analysed exemplar.
    metres_per_pixel : scale of the exemplar; may be finer or coarser than the raster of a wall.
    """

    style: ExemplarAnalysis
    metres_per_pixel: float


@dataclass(frozen=True)
class BuildingPaint:
    """Paint that all walls of a building share.

    Attributes
    ----------
    building_seed : seed of the shade.
    wall_colour : (3,) 0..255, colour of the walls where photos show it.
    """

    building_seed: int = 0
    wall_colour: Float64Array | None = None


PLAIN_PAINT = BuildingPaint()


def build_facade_from_exemplar(
    scaled: ScaledStyle,
    wall: FacadeWall,
    size: tuple[int, int],
    *,
    span: tuple[float, float] | None = None,
    paint: BuildingPaint = PLAIN_PAINT,
    seed: int = 0,
) -> Facade:
    """Build a wall without imagery in the style of an exemplar.

    A street wall with an implausible layout is composed again with other numbers of bays, and the most plausible composition
    taken. Texels of walls on no street behind a neighbour are marked as unseen.

    Parameters
    ----------
    scaled : style of the wall.
    wall : metric wall.
    size : (h, w) of the raster to fill.
    span : left and right end, metres, of the part of a wall that turns a bend; the whole wall by default.
    paint : paint of the building.
    seed : seed of the composition and of the panes.
    """
    seconds: dict[str, float] = {}
    span = span or (0.0, wall.width)
    with time_stage(seconds, "retarget"):
        made = _compose_part(scaled, wall, size, span, seed, 0)
        if wall.on_street and made.plausibility is not None and made.plausibility < MIN_PLAUSIBLE_SCORE:
            others = [_compose_part(scaled, wall, size, span, seed, more) for more in OTHER_BAYS]
            made = max([made, *others], key=lambda one: -np.inf if one.plausibility is None else one.plausibility)
    texture, labels, layout, plausibility = made
    with time_stage(seconds, "vary"):
        # Permute window states between walls of one exemplar and between repeated bays.
        texture, varied = permute_photo_elements(texture, find_variations(texture, layout), EXCHANGE_LEVEL, seed)
        factors = _paint_factors(texture, labels, paint.wall_colour)
        texture = tint_facade(texture, labels, building_seed=paint.building_seed, seed=seed, paint=factors)
    with time_stage(seconds, "lattice"):
        split = lattice(labels)
    with time_stage(seconds, "encode"):
        hierarchy = encode_variations(texture, varied) if layout else None
    known = np.ones(size, bool) if wall.on_street else _free_mask(wall, span, size)
    return Facade(
        evidence=texture,
        image=texture,
        labels=labels,
        occluded=np.zeros(size, bool),
        provenance=np.where(known, Provenance.SYNTHESISED, Provenance.UNSEEN).astype(np.uint8),
        masked=(),
        masked_share=0.0,
        lattice=split,
        elements=layout,
        hierarchy=hierarchy,
        completion=None,
        estimates=None,
        floors=count_floors(labels),
        seconds=seconds,
        plausibility=plausibility,
    )


class _Composition(NamedTuple):
    """Composed part of a wall: image, labels, elements, and the plausibility of these; None without any."""

    image: UInt8Array
    labels: UInt8Array
    layout: tuple[Element, ...]
    plausibility: float | None


def _compose_part(
    scaled: ScaledStyle, wall: FacadeWall, size: tuple[int, int], span: tuple[float, float], seed: int, more_bays: int
) -> _Composition:
    """Compose a wall, and cut out the part between two ends in metres, of a size (h, w)."""
    import cv2

    # A back with a door needs full resolution too: the joints of the door are finer than a texel.
    full_resolution = wall.on_street or wall.has_back_door
    texel = wall.height / size[0]
    pixel = scaled.metres_per_pixel if full_resolution else max(scaled.metres_per_pixel, texel / OVERSAMPLING)
    texture, labels = compose_wall(
        scaled.style,
        wall,
        metres_per_pixel=scaled.metres_per_pixel,
        output_metres_per_pixel=pixel,
        texel_m=texel,
        seed=seed,
        more_bays=more_bays,
    )
    left, right = (round(end / pixel) for end in span)
    columns = slice(left, max(left + 1, right))
    texture, labels = resize_image(np.ascontiguousarray(texture[:, columns]), size), labels[:, columns]
    if labels.shape != size:
        labels = np.asarray(cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST), labels.dtype)
    layout = tuple(elements(labels))
    return _Composition(texture, labels, layout, score(layout, (0.0, 0.0, size[1], size[0])) if layout else None)


def _paint_factors(texture: UInt8Array, labels: UInt8Array, colour: Float64Array | None) -> Float64Array | None:
    """Return (3,) factors that bring a texture's wall to a colour; None without a wall or a colour."""
    is_wall = labels == FacadeClass.WALL
    if colour is None or not is_wall.any():
        return None
    return np.asarray(
        np.clip(colour / np.maximum(lit_colour(texture[is_wall]), 1), 1 / MAX_PAINT_FACTOR, MAX_PAINT_FACTOR)
    )


def _free_mask(wall: FacadeWall, span: tuple[float, float], size: tuple[int, int]) -> BoolArray:
    """Mark, (h, w) bool, the texels of a part of a wall that no neighbour covers."""
    import cv2

    mask = np.zeros(size, np.uint8)
    scale = np.array([size[1] / (span[1] - span[0]), size[0] / wall.height])
    for polygon in shapely.get_parts(wall.free.buffer(FREE_MARGIN_M)):
        rings = [polygon.exterior, *polygon.interiors]
        corners = [np.rint((shapely.get_coordinates(ring) - [span[0], 0]) * scale).astype(np.int32) for ring in rings]
        cv2.fillPoly(mask, corners[:1], 1)
        if corners[1:]:
            cv2.fillPoly(mask, corners[1:], 0)
    return mask.astype(bool)
