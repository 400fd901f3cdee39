"""Floors of a wall: borders common to all walls of a building, and the exemplar's floor that each shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.retargeting import ExemplarAnalysis, choose_exemplar_floors, lattice_rows
from facade_core.facade.texture.settings import FLOORS
from facade_core.geometry.settings import FACADE_WALLS


@dataclass(frozen=True, slots=True)
class FacadeWall:
    """Wall, or several walls composed as one, in metres.

    Attributes
    ----------
    width, height : size.
    foot : height of its foot over the base of its building.
    eaves : height of the building's eaves over its base.
    floors : number of floors up to the eaves.
    on_street : True if it shows doors and shops.
    is_back : True for a back, without the ornaments of a front.
    free : part that no neighbour covers, x right and y down.
    is_raised : True if its building begins above the ground, with an upper floor.
    seams : borders of joined walls, metres from the left.
    is_corner : True for a narrow wall between two walls on streets.
    has_back_door : True for a back with the entrance of the building.
    entrances : mapped doors, metres from the left.
    """

    width: float
    height: float
    foot: float
    eaves: float
    floors: int
    on_street: bool
    is_back: bool
    free: BaseGeometry
    is_raised: bool = False
    seams: tuple[float, ...] = ()
    is_corner: bool = False
    has_back_door: bool = False
    entrances: tuple[float, ...] = ()

    @classmethod
    def freestanding(cls, height: float, width: float, floors: int) -> FacadeWall:
        """Return a wall on a street without neighbours, as high as its building."""
        return cls(
            width, height, 0.0, height, floors, on_street=True, is_back=False, free=shapely.box(0, 0, width, height)
        )


@dataclass(frozen=True, slots=True)
class WallFloor:
    """Floor of a wall.

    Attributes
    ----------
    exemplar_floor : exemplar's floor that it shows, -1 for a ground floor without windows.
    heights : metres above, across and below its windows; one height without windows.
    attic, plinth : height of the bare wall above and below these, metres.
    is_crowned : True if it shows the exemplar's top.
    """

    exemplar_floor: int
    heights: tuple[float, ...]
    attic: float
    plinth: float
    is_crowned: bool

    @property
    def all_heights(self) -> tuple[float, ...]:
        """Return the heights of all its bands from the top, bare wall included, metres."""
        bare = [(height,) if height > 0 else () for height in (self.attic, self.plinth)]
        return (*bare[0], *self.heights, *bare[1])


def plainest_floor(style: ExemplarAnalysis) -> int:
    """Return the exemplar's floor with the fewest balconies.

    The topmost and the lowest floor are avoided if possible, since cornices and shops reach into them.
    """
    exemplar = style.structure
    middle = [k for k, kind in enumerate(exemplar.kinds) if kind == "middle"]
    cuts = exemplar.floor_cuts
    ends = {middle[0]: 2.0, middle[-1]: 1.0}
    adorned = [ends.get(k, 0.0) + (style.labels[cuts[k] : cuts[k + 1]] == FacadeClass.BALCONY).mean() for k in middle]
    return middle[int(np.argmin(adorned))]


def stack_floors(style: ExemplarAnalysis, wall: FacadeWall, metres_per_pixel: float) -> tuple[list[WallFloor], float]:
    """Stack the floors of a wall from its top, with the borders of its building.

    Parameters
    ----------
    style : analysed exemplar.
    wall : metric wall.
    metres_per_pixel : scale of the exemplar.

    Returns
    -------
    Floors from the top, and the metres of an exemplar pixel on them.
    """
    pixels, count = round(wall.eaves / metres_per_pixel), limit_floor_count(wall.floors, wall.eaves)
    own, heights, scale = _exemplar_floors(style, pixels, count)
    storeys = np.diff(style.structure.floor_cuts)[np.array(style.structure.kinds) != "roof"]
    scale = min(scale * metres_per_pixel, FLOORS.max_shown_storey_m / float(storeys.min()))
    heights = _limit_heights(heights * (wall.eaves / heights.sum()))
    lines = np.concatenate([[0.0], np.cumsum(heights[::-1])])
    at_eaves = abs(wall.foot + wall.height - wall.eaves) < FLOORS.eaves_tolerance_m
    shown = _ShownFloors(style, own, lines, plainest_floor(style), at_eaves)
    has_ground_floor = (wall.on_street or wall.is_corner) and not wall.is_raised and shown.kind(own[-1]) == "ground"
    borders = _floor_borders(wall, lines, has_ground_floor)
    stack = []
    for number, (low, high) in enumerate(zip(borders[:-1], borders[1:], strict=True)):
        is_ground, is_highest = number == 0 and has_ground_floor, number == len(borders) - 2
        if is_ground:
            floor, is_crowned = own[-1], is_highest and at_eaves and not wall.is_back
        else:
            floor, is_crowned = _choose_upper_floor(wall, shown, (low, high), is_highest=is_highest)
        is_above = is_ground or (is_highest and not is_crowned)
        bands, attic, plinth = _fit_bands(style, floor, high - low, scale, is_above=is_above)
        stack.append(WallFloor(floor, bands, attic, plinth, is_crowned))
    return stack[::-1], scale


class _ShownFloors(NamedTuple):
    """Floors of an exemplar that a building shows.

    Attributes
    ----------
    style : analysed exemplar.
    own : its floors from the top, as the building has them.
    lines : (n,) borders of these from the foot up, metres.
    plain : its plainest floor.
    at_eaves : whether the wall ends at the eaves.
    """

    style: ExemplarAnalysis
    own: list[int]
    lines: Float64Array
    plain: int
    at_eaves: bool

    def kind(self, floor: int) -> str:
        """Return the kind of a floor; one without windows is a ground floor."""
        return "ground" if floor < 0 else self.style.structure.kinds[floor]

    def between(self, low: float, high: float) -> int:
        """Return the floor between two heights, if they are not of the ground floor."""
        place = int(np.searchsorted(self.lines, (low + high) / 2)) - 1
        floor = self.own[len(self.own) - 1 - place] if 0 <= place < len(self.own) else self.plain
        kind = self.kind(floor)
        return self.plain if kind == "ground" or (kind == "roof" and not self.at_eaves) else floor


def _floor_borders(wall: FacadeWall, lines: Float64Array, has_ground_floor: bool) -> Float64Array:
    """Return the borders (n,) of the floors of a wall from its foot to its top, metres.

    They are those of its building, unless the wall's upper floors would be too high or too low: then these are equal.

    Parameters
    ----------
    lines : (m,) borders of the floors of its building, metres.
    """
    top, usual = wall.foot + wall.height, np.diff(lines)[1:] if len(lines) > 2 else np.diff(lines)
    pitch = float(np.clip(usual.mean(), *FACADE_WALLS.floor_height_m))
    beyond = np.arange(1, 2 + int((abs(wall.foot) + top) / pitch)) * pitch
    every = np.concatenate([-beyond[::-1], lines, wall.eaves + beyond])
    inner = every[(every > wall.foot + FLOORS.min_floor_m) & (every < top - FLOORS.min_floor_m)]
    borders = np.concatenate([[wall.foot], inner, [top]])
    ground, upper = np.split(borders, [int(has_ground_floor and len(inner) > 0)])
    if np.diff(upper).max() <= FLOORS.max_floor_stretch * pitch:
        return borders
    count = max(1, min(round((top - upper[0]) / pitch), int((top - upper[0]) / FLOORS.min_floor_m)))
    return np.concatenate([ground, np.linspace(upper[0], top, count + 1)])


def _choose_upper_floor(
    wall: FacadeWall, shown: _ShownFloors, span: tuple[float, float], *, is_highest: bool
) -> tuple[int, bool]:
    """Choose the exemplar's floor for a floor above the ground floor; returns also whether it shows the exemplar's top.

    A wall that ends above or below the eaves shows it too if its top is level and on a street.
    """
    ends_in_cornice = wall.on_street and shown.kind(0) == "middle" and is_level(wall)
    is_crowned = is_highest and (not wall.is_back if shown.at_eaves else ends_in_cornice)
    floor = 0 if is_crowned and not shown.at_eaves else shown.between(*span)
    if not wall.on_street and not is_crowned and shown.kind(floor) == "middle":
        floor = shown.plain
    return floor, is_crowned


def _fit_bands(
    style: ExemplarAnalysis, floor: int, height: float, scale: float, *, is_above: bool
) -> tuple[tuple[float, ...], float, float]:
    """Fit the bands of an exemplar's floor to a height, metres.

    Parameters
    ----------
    is_above : whether bare wall is above the bands, as above doors and shops, or below, as below a crown.

    Returns
    -------
    Heights of the bands, and of the bare wall above and below them.
    """
    grid, rows = np.asarray(style.grid.rows), lattice_rows(style, floor)
    natural = scale * float(grid[rows.stop] - grid[rows.start])
    bare = max(0.0, height - FLOORS.max_floor_stretch * natural)
    bands = _band_heights(style, floor, height - bare, scale)
    return (bands, bare, 0.0) if is_above else (bands, 0.0, bare)


def limit_floor_count(floors: int, height: float) -> int:
    """Return the number of floors nearest to a stated one of which each has the height of a floor.

    Parameters
    ----------
    floors : stated number.
    height : height of all of them, metres.
    """
    least = math.ceil((height - FLOORS.max_ground_floor_m) / FACADE_WALLS.floor_height_m[1] - 1e-6) + 1
    most = math.floor(height / FACADE_WALLS.floor_height_m[0] + 1e-6)
    return max(1, min(max(floors, least), most))


def _exemplar_floors(style: ExemplarAnalysis, pixels: int, count: int) -> tuple[list[int], Float64Array, float]:
    """Return the exemplar's floors from the top, their heights (n,) in pixels, and the scale.

    A base that is too low for a floor belongs to the lowest floor.
    """
    own, scale = choose_exemplar_floors(style, pixels, count, np.random.default_rng(0), 0.0)
    rows = [lattice_rows(style, floor) for floor in own]
    heights = np.array([style.grid.rows[row.stop] - style.grid.rows[row.start] for row in rows], float)
    if len(own) > 1 and own[-1] < 0 and not style.structure.has_ground_band:
        own, heights = own[:-1], np.append(heights[:-2], heights[-2:].sum())
    return own, heights, scale


def _limit_heights(heights: Float64Array) -> Float64Array:
    """Make heights (n,) as equal as needed for all to be within the limits of a floor; the sum stays.

    If their mean exceeds the limit, the lowest takes what is left by the others.
    """
    mean = heights.mean()
    off = heights - mean
    low, high = FACADE_WALLS.floor_height_m
    if mean > high:
        return np.append(np.full(len(heights) - 1, high), heights.sum() - high * (len(heights) - 1))
    if mean < low or not off.any():
        return heights
    room = np.where(off > 0, high - mean, mean - low)
    limited: Float64Array = mean + off * min(1.0, float((room[off != 0] / np.abs(off[off != 0])).min()))
    return limited


def _band_heights(style: ExemplarAnalysis, floor: int, height: float, scale: float) -> tuple[float, ...]:
    """Divide a floor's height, metres, into the bands above, across and below its windows.

    Windows keep their height if possible.
    """
    rows = lattice_rows(style, floor)
    sizes = scale * np.diff(np.asarray(style.grid.rows)[rows.start : rows.stop + 1])
    if len(sizes) < 3:
        return tuple((sizes * (height / sizes.sum())).tolist())
    above, window, below = sizes.tolist()
    window *= float(np.clip(height / sizes.sum(), 1.0, FLOORS.max_window_stretch))
    most = max(FLOORS.max_window_share * height, (1 - FLOORS.max_window_loss) * window)
    window = min(window, most, (1 - 2 * FLOORS.min_spandrel_share) * height)
    return (height - window) * above / (above + below), window, (height - window) * below / (above + below)


def shows_ground_floor(style: ExemplarAnalysis, wall_floor: WallFloor) -> bool:
    """Return whether a floor shows the exemplar's ground floor."""
    return wall_floor.exemplar_floor < 0 or style.structure.kinds[wall_floor.exemplar_floor] == "ground"


def is_level(wall: FacadeWall) -> bool:
    """Return whether the top of a wall is level and free."""
    return bool(wall.free.buffer(FLOORS.level_top_m).covers(shapely.LineString([(0, 0), (wall.width, 0)])))
