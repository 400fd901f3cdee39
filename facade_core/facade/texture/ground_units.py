"""Ground floor of a street wall from whole elements of the exemplar: shops, doors and gates with the piers beside them.

Bays follow the windows of the upper floors, so a cut between bays can divide a shop or an awning. Units are cut through piers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, IntArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Lattice
from facade_core.facade.texture.retargeting import ExemplarAnalysis, lattice_rows
from facade_core.facade.texture.settings import GROUND_FLOOR, RETARGETING
from facade_core.facade.texture.shortest_walks import part_transition_costs
from facade_core.facade.texture.tile_composition import compose_tiles
from facade_core.facade.texture.wall_floors import FacadeWall, WallFloor
from facade_core.parsing.floor_structure import spans_above_threshold

_ELEMENTS = (FacadeClass.SHOP, FacadeClass.DOOR, FacadeClass.WINDOW, FacadeClass.BALCONY)


@dataclass(frozen=True, eq=False)
class GroundUnits:
    """Units of an exemplar's ground floor from left to right; each is a pier, an element and a pier.

    Attributes
    ----------
    columns : (3 n + 1,) borders of piers and elements, pixels.
    price : (n, n) price of showing one unit left of another.
    has_door, has_entrance : (n,) whether it shows a door; a door or a shop.
    """

    columns: Int64Array
    price: Float64Array
    has_door: BoolArray
    has_entrance: BoolArray

    @property
    def widths(self) -> Float64Array:
        """Return the widths (n,) in pixels."""
        return np.diff(self.columns[::3]).astype(np.float64)


def find_ground_units(image: UInt8Array, labels: UInt8Array, metres_per_pixel: float) -> GroundUnits | None:
    """Find the units of a ground floor; None without elements.

    Parameters
    ----------
    image : (h, w, 3) uint8 ground floor of an exemplar.
    labels : (h, w) uint8 class ids.
    metres_per_pixel : scale of the exemplar.
    """
    width = labels.shape[1]
    shown = np.isin(labels, _ELEMENTS).mean(axis=0)
    spans: list[tuple[int, int]] = []
    for left, right in spans_above_threshold(shown, GROUND_FLOOR.min_element_share):
        if spans and left - spans[-1][1] < GROUND_FLOOR.min_pier_m / metres_per_pixel:
            spans[-1] = spans[-1][0], right
        else:
            spans.append((left, right))
    spans = [(left, right) for left, right in spans if right - left >= GROUND_FLOOR.min_element_m / metres_per_pixel]
    if not spans:
        return None
    cuts = [0, *((a + b) // 2 for (_, a), (b, _) in pairwise(spans)), width]
    columns = [0]
    for (left, right), end in zip(spans, cuts[1:], strict=True):
        # piers have a pixel at least, so that columns ascend
        columns += [min(max(left, columns[-1] + 1), end - 2), min(max(right, columns[-1] + 2), end - 1), end]
    return GroundUnits(
        np.array(columns, np.int64),
        part_transition_costs(image, labels, np.array(cuts), [0, len(labels)]).step,
        _shows(labels, cuts, (FacadeClass.DOOR,), metres_per_pixel),
        _shows(labels, cuts, (FacadeClass.DOOR, FacadeClass.SHOP), metres_per_pixel),
    )


def _shows(
    labels: UInt8Array, cuts: Sequence[int], classes: Sequence[FacadeClass], metres_per_pixel: float
) -> BoolArray:
    """Return which parts (n,) between cuts show elements of some classes."""
    columns: BoolArray = np.asarray(np.isin(labels, classes).any(axis=0))
    return np.array([columns[a:b].sum() * metres_per_pixel >= GROUND_FLOOR.min_element_m for a, b in pairwise(cuts)])


def arrange_units(
    units: GroundUnits,
    width: float,
    metres_per_pixel: float,
    rng: np.random.Generator,
    entrances: Sequence[float] = (),
) -> tuple[Int64Array, Float64Array] | None:
    """Arrange units along a wall: the cheapest sequence by transitions and stretch.

    Parameters
    ----------
    units : units of the exemplar.
    width : width of the wall, metres.
    metres_per_pixel : scale at which the units are shown.
    rng : draws the noise of prices.
    entrances : mapped doors, metres from the left.

    Returns
    -------
    Units (k,) from the left, and the borders (3 k + 1,) of their piers and elements, metres; None where elements would be
    stretched too far.
    """
    price = units.price * np.exp(RETARGETING.price_noise * rng.standard_normal(units.price.shape))
    chosen = _cheapest_sequence(price, units.widths * metres_per_pixel, units.has_door, width)
    sizes = metres_per_pixel * np.diff(units.columns).reshape(-1, 3)
    fitted = _fit_units(sizes[chosen], width).sum(axis=1)
    middle, doors = np.cumsum(fitted) - fitted / 2, np.flatnonzero(units.has_door)
    for place in entrances:
        is_near = np.abs(middle - place) < fitted / 2 + GROUND_FLOOR.max_entrance_offset_m
        if len(doors) and not (units.has_entrance[chosen] & is_near).any():
            own = int(np.argmin(np.abs(middle - place)))
            chosen[own] = doors[np.argmin(np.abs(units.widths[doors] - units.widths[chosen[own]]))]
    across = _fit_units(sizes[chosen], width)
    stretch = across[:, 1].sum() / sizes[chosen, 1].sum()
    if not GROUND_FLOOR.element_stretch[0] <= stretch <= GROUND_FLOOR.element_stretch[1]:
        return None
    return chosen, np.append(0.0, np.cumsum(across.ravel()))


def _fit_units(sizes: Float64Array, width: float) -> Float64Array:
    """Fit piers and elements (k, 3) to a width, metres: elements keep theirs as far as piers have room."""
    piers, elements = float(sizes[:, [0, 2]].sum()), float(sizes[:, 1].sum())
    pier = float(np.clip((width - elements) / piers, *GROUND_FLOOR.pier_stretch))
    fitted: Float64Array = sizes * np.array([pier, (width - pier * piers) / elements, pier])
    return fitted


def _cheapest_sequence(price: Float64Array, widths: Float64Array, has_door: BoolArray, total: float) -> Int64Array:
    """Return the sequence (k,) of parts of some widths (n,), metres, with the least price and stretch to a total.

    Each house of the exemplar's width has at most one door, and the whole at least one, unless that costs more than
    `no_door_cost`.
    """
    count, steps = len(widths), np.maximum(1, np.rint(widths / GROUND_FLOOR.width_step_m).astype(int))
    most = int(1.5 * total / GROUND_FLOOR.width_step_m) + int(steps.max())
    houses = max(1, int(total / float(widths.sum())))
    inner = np.zeros(count)
    inner[[0, -1]] = GROUND_FLOOR.end_unit_cost
    # by the doors so far, the width so far and the last part
    score = np.full((houses + 1, most + 1, count), np.inf)
    came = np.full((houses + 1, most + 1, count, 2), -1)
    for part, step in enumerate(steps.tolist()):
        score[int(has_door[part]), step, part] = inner[part] * (part > 0)
    for at in range(1, most + 1):
        for part in np.flatnonzero(steps < at).tolist():
            options = score[:, at - steps[part]] + price[:, part] + inner[part]
            options[:, part] += GROUND_FLOOR.repeat_cost
            for before in range(houses + 1 - int(has_door[part])):
                after, best = before + int(has_door[part]), int(np.argmin(options[before]))
                if options[before, best] < score[after, at, part]:
                    score[after, at, part], came[after, at, part] = options[before, best], (before, best)
    score[came[..., count - 1, 0] >= 0, count - 1] -= inner[count - 1]  # the exemplar's end is at the wall's
    score[0] += GROUND_FLOOR.no_door_cost * has_door.any()
    score[:, 1:] += (
        GROUND_FLOOR.stretch_cost * np.log(total / (GROUND_FLOOR.width_step_m * np.arange(1, most + 1))) ** 2
    )[:, None]
    score[:, int(total / GROUND_FLOOR.element_stretch[0] / GROUND_FLOOR.width_step_m) + 1 :] += (
        GROUND_FLOOR.squeezed_cost
    )
    doors, at, part = (int(one) for one in np.unravel_index(np.argmin(score), score.shape))
    found = [part]
    while (before := came[doors, at, part])[0] >= 0:
        at -= int(steps[part])
        doors, part = before.tolist()
        found.append(part)
    return np.array(found[::-1])


def paint_ground_units(
    style: ExemplarAnalysis,
    wall: FacadeWall,
    wall_floor: WallFloor,
    bays: IntArray,
    image: UInt8Array,
    labels: UInt8Array,
    rows: Int64Array,
    scale: float,
    metres_per_pixel: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    """Paint a ground floor of whole elements on a wall, in place; nothing where its bays have to show it.

    Without shops bays show it unless they would cut an element, as its windows stay below those of the upper floors.

    Parameters
    ----------
    style : analysed exemplar.
    wall : metric wall.
    wall_floor : its ground floor.
    bays : bays that it shows.
    image : (h, w, 3) uint8; changed in place.
    labels : (h, w) uint8; changed in place.
    rows : borders of the ground floor's rows, down to the foot, pixels.
    scale : metres of a pixel of the exemplar on this wall.
    metres_per_pixel : scales of the exemplar and of `image`.
    rng : draws the noise of prices.
    """
    top, pixel = int(rows[0]), metres_per_pixel[1]
    area = shapely.box(0.0, top * pixel, wall.width, len(labels) * pixel)
    if wall.seams or not wall.free.buffer(GROUND_FLOOR.free_tolerance_m).covers(area):
        return
    own = lattice_rows(style, wall_floor.exemplar_floor)
    down = np.asarray(style.grid.rows[own.start : own.stop + 1])
    whole = (style.image[down[0] : down[-1]], style.labels[down[0] : down[-1]])
    are_bays_shown = bays.max() < len(style.structure.bays)
    if not (whole[1] == FacadeClass.SHOP).any() and not (
        are_bays_shown and style.bay_price["ground"].cuts_elements(bays)
    ):
        return
    units = find_ground_units(*whole, metres_per_pixel[0])
    if units is None or (arranged := arrange_units(units, wall.width, scale, rng, wall.entrances)) is None:
        return
    borders = down - down[0], rows - top
    image[top:], labels[top:] = compose_units(whole, units, arranged, borders, labels.shape[1], metres_per_pixel)


def compose_units(
    source: tuple[UInt8Array, UInt8Array],
    units: GroundUnits,
    arranged: tuple[Int64Array, Float64Array],
    rows: tuple[Int64Array, Int64Array],
    width: int,
    metres_per_pixel: tuple[float, float],
) -> tuple[UInt8Array, UInt8Array]:
    """Compose a ground floor from arranged units.

    Parameters
    ----------
    source : image (h, w, 3) uint8 and labels (h, w) uint8 of the exemplar's ground floor.
    units, arranged : its units, and their arrangement by `arrange_units`.
    rows : borders (m,) of its rows, and of those of the result, pixels.
    width : width of the result, pixels.
    metres_per_pixel : scales of the exemplar and of the result.

    Returns
    -------
    Image and labels.
    """
    chosen, across = arranged
    columns = np.rint(across / metres_per_pixel[1]).astype(np.int64)
    columns[-1] = width
    wide, bands = len(units.columns) - 1, len(rows[0]) - 1
    tiles = wide * np.arange(bands)[:, None] + (3 * chosen[:, None] + np.arange(3)).ravel()
    return compose_tiles(
        np.ascontiguousarray(source[0]),
        np.ascontiguousarray(source[1]),
        Lattice(tuple(rows[0].tolist()), tuple(units.columns.tolist())),
        tiles.astype(np.int32),
        rows[1],
        columns,
        metres_per_pixel[1] / metres_per_pixel[0],
    )
