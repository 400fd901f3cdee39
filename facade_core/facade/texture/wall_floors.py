"""The storeys of a wall: where they lie, the same on all walls of a building, and which of the exemplar's each shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.retargeting import ExemplarStyle, choose_floors, lattice_rows
from facade_core.geometry.walls import FLOOR_HEIGHT_M

# What of a storey is left at a wall's foot or top belongs to the storey beside it where it is lower than this.
MIN_FLOOR_M = 2.2
# A wall ends at the eaves where it ends this near to them: there it shows what crowns the exemplar.
EAVES_TOLERANCE_M = 0.3
# The topmost storey has bare wall over it where it is so many times as high as its exemplar's.
MAX_TOP_FLOOR_STRETCH = 1.15


@dataclass(frozen=True, slots=True)
class FacadeWall:
    """A wall, or several that are laid out as one, in metres.

    width, height; foot over the base of its building; eaves of that over its base, and storeys up to there. street: whether it
    shows doors and shops; plain: whether it is a back, without what adorns a front. free: where it stands against no
    neighbour, x right and y down. raised: whether its building begins above the ground, and so with an upper floor.
    seams: where one of several walls ends and the next begins, metres from the left. corner: whether it is narrow and turns the
    corner between two that are on streets; door: whether it is a back by which the building is entered. entrances: where a map
    has doors in it, metres from the left.
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
        """One on a street, that nothing stands against, of a building as high."""
        return cls(width, height, 0.0, height, floors, on_street=True, is_back=False, free=shapely.box(0, 0, width, height))


@dataclass(frozen=True, slots=True)
class WallFloor:
    """One of a wall, from the top: the exemplar's floor that it shows, -1 for a ground floor without windows; the three heights
    above, across and below its windows, or the one of a floor without, and of the bare wall over it, in metres; whether it is
    crowned by the exemplar's top."""

    exemplar_floor: int
    heights: tuple[float, ...]
    attic: float
    is_crowned: bool


def plainest_floor(style: ExemplarStyle) -> int:
    """The exemplar's floor for where nothing adorns a wall: with the fewest balconies, not the topmost
    or the lowest if there is another: cornices and shops reach into these."""
    exemplar = style.structure
    middle = [k for k, kind in enumerate(exemplar.kinds) if kind == "middle"]
    cuts = exemplar.floor_cuts
    ends = {middle[0]: 2.0, middle[-1]: 1.0}
    adorned = [ends.get(k, 0.0) + (style.labels[cuts[k] : cuts[k + 1]] == FacadeClass.BALCONY).mean() for k in middle]
    return middle[int(np.argmin(adorned))]


def stack_floors(
    style: ExemplarStyle, wall: FacadeWall, metres_per_pixel: float, floor_style: ExemplarStyle | None = None
) -> tuple[list[WallFloor], float]:
    """The storeys of a wall from its top, whose borders are those of its building, and the metres that a pixel of the exemplar
    takes on them."""
    pixels = round(wall.eaves / metres_per_pixel)
    own, scale = choose_floors(style, pixels, wall.floors, np.random.default_rng(0), 0.0)
    scale, plain = scale * metres_per_pixel, plainest_floor(style)
    kinds, grid = style.structure.kinds, np.asarray(style.grid.rows)
    heights = _floor_heights(style, own)
    if floor_style is not None:
        theirs, _ = choose_floors(floor_style, pixels, wall.floors, np.random.default_rng(0), 0.0)
        heights = _floor_heights(floor_style, theirs) if len(theirs) == len(own) else heights
    heights = _limit_heights(heights * (wall.eaves / heights.sum()))
    lines = np.concatenate([[0.0], np.cumsum(heights[::-1])])
    pitch, top = wall.eaves / len(own), wall.foot + wall.height
    beyond = np.arange(1, 2 + int((abs(wall.foot) + top) / pitch)) * pitch
    every = np.concatenate([-beyond[::-1], lines, wall.eaves + beyond])
    inner = every[(every > wall.foot + MIN_FLOOR_M) & (every < top - MIN_FLOOR_M)]
    borders = np.concatenate([[wall.foot], inner, [top]])
    at_eaves = abs(top - wall.eaves) < EAVES_TOLERANCE_M
    stack = []
    for number, (low, high) in enumerate(zip(borders[:-1], borders[1:], strict=True)):
        place = int(np.searchsorted(lines, (low + high) / 2)) - 1
        floor = own[len(own) - 1 - place] if 0 <= place < len(own) else plain
        lowest, highest = number == 0, number == len(borders) - 2
        kind = "ground" if floor < 0 else kinds[floor]
        if (
            lowest
            and (wall.on_street or wall.is_corner)
            and not wall.is_raised
            and (own[-1] < 0 or kinds[own[-1]] == "ground")
        ):
            floor = own[-1]
        elif kind == "ground" or (kind == "roof" and not at_eaves):
            floor = plain
        crowned = highest and at_eaves and not wall.is_back
        if not wall.on_street and not crowned and kind == "middle":
            floor = plain
        natural = scale * float(grid[lattice_rows(style, floor).stop] - grid[lattice_rows(style, floor).start])
        attic = (
            high - low - natural if highest and not crowned and high - low > MAX_TOP_FLOOR_STRETCH * natural else 0.0
        )
        stack.append(WallFloor(floor, _band_heights(style, floor, high - low - attic, scale), attic, crowned))
    return stack[::-1], scale


def _floor_heights(style: ExemplarStyle, floors: list[int]) -> np.ndarray:
    """How high floors (n,) of an exemplar are, (n,) pixels."""
    rows = [lattice_rows(style, floor) for floor in floors]
    return np.array([style.grid.rows[row.stop] - style.grid.rows[row.start] for row in rows], float)


def _limit_heights(heights: np.ndarray) -> np.ndarray:
    """Heights of storeys (n,) with the same sum, made as alike as it takes for all to be within STOREY_M."""
    mean = heights.mean()
    off = heights - mean
    low, high = FLOOR_HEIGHT_M
    if not low <= mean <= high or not off.any():
        return heights
    room = np.where(off > 0, high - mean, mean - low)
    return mean + off * min(1.0, float((room[off != 0] / np.abs(off[off != 0])).min()))


def _band_heights(style: ExemplarStyle, floor: int, height: float, scale: float) -> tuple[float, ...]:
    """What a storey of some height, metres, has above, across and below its windows, which keep theirs where they can."""
    rows = lattice_rows(style, floor)
    sizes = scale * np.diff(np.asarray(style.grid.rows)[rows.start : rows.stop + 1])
    if len(sizes) < 3:
        return tuple((sizes * (height / sizes.sum())).tolist())
    above, window, below = sizes.tolist()
    window = min(window, 0.75 * height)
    return (height - window) * above / (above + below), window, (height - window) * below / (above + below)


def shows_ground_floor(style: ExemplarStyle, wall_floor: WallFloor) -> bool:
    """Whether a storey shows the exemplar's ground floor."""
    return wall_floor.exemplar_floor < 0 or style.structure.kinds[wall_floor.exemplar_floor] == "ground"
