"""Compose an exemplar's style on the walls of a building.

Floors meet at corners, windows are whole, backs are plain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Lattice
from facade_core.facade.texture.bare_wall import (
    bare_columns,
    blank_bays_at_door,
    blank_cells,
    blank_ground,
    floor_rows,
    insert_bare_rows,
    paint_coping,
    plaster_bare_wall,
)
from facade_core.facade.texture.doors import paint_door
from facade_core.facade.texture.entrances import choose_door_position, place_doors
from facade_core.facade.texture.ground_units import paint_ground_units
from facade_core.facade.texture.retargeting import ExemplarAnalysis, fit_sizes_to_total, initial_tiling, refine_tiling
from facade_core.facade.texture.settings import BAYS, FLOORS, RETARGETING
from facade_core.facade.texture.tile_composition import compose_tiles
from facade_core.facade.texture.wall_floors import (
    FacadeWall,
    WallFloor,
    plainest_floor,
    shows_ground_floor,
    stack_floors,
)


def compose_wall(
    style: ExemplarAnalysis,
    wall: FacadeWall,
    *,
    metres_per_pixel: float,
    output_metres_per_pixel: float | None = None,
    texel_m: float | None = None,
    seed: int = 0,
    more_bays: int = 0,
) -> tuple[UInt8Array, UInt8Array]:
    """Compose image and labels of a wall in an exemplar's style.

    Floor borders depend on the exemplar, the building's height and its floors only, so that they meet at corners. A
    floor shows windows where they fit into the free part of the wall, and wall elsewhere.

    Parameters
    ----------
    style : analysed exemplar.
    wall : metric wall.
    metres_per_pixel : scale of the exemplar.
    output_metres_per_pixel : scale of the result; that of the exemplar by default.
    texel_m : metres of a texel of the final raster; a pixel of the result by default.
    seed : seed of the composition.
    more_bays : bays more than fit best, in the widest section.

    Returns
    -------
    Image (h, w, 3) uint8 and labels (h, w) uint8.

    Raises
    ------
    ImageError
        For a wall of less than 2 pixels a side, or without floors.
    """
    pixel = output_metres_per_pixel or metres_per_pixel
    size = round(wall.height / pixel), round(wall.width / pixel)
    if min(size) < 2 or wall.floors < 1:
        raise ImageError(f"on_wall: {size} px and {wall.floors} storeys; pass at least 2 px a side and 1 storey")
    rng = np.random.default_rng(seed)
    plain = plainest_floor(style)
    stack, scale = stack_floors(style, wall, metres_per_pixel)

    ends, counts = _divide_into_bays(style, wall, scale, more_bays)
    blank, count = not counts, sum(counts) or 1
    wide = len(style.grid.columns) - 1
    source = _choose_tiles(style, wall, stack, count, plain, rng, blank=blank)
    if blank:
        across = np.array([0.0, wall.width])
    else:
        widths = scale * np.diff(style.grid.columns)[source[1]].mean(axis=0)
        apart = max(BAYS.seam_margin_m, BAYS.seam_margin_texels * (texel_m or pixel))
        across = _move_off_seams(_fit_bays(widths, counts, ends), wall.seams, apart)
    source = insert_bare_rows(style, stack, source, plain)
    down = np.append(0.0, np.cumsum([height for wall_floor in stack for height in wall_floor.all_heights]))
    blank_cells(style, wall, stack, source, down, across, plain, blank)
    ground = floor_rows(stack)[-1]
    if wall.is_corner:
        blank_ground(style, stack[-1], source[:, ground], plain)
    is_front = wall.on_street and not blank and shows_ground_floor(style, stack[-1])
    if is_front:
        place_doors(style, wall.entrances, source[:, ground], across)
    bays = source[1, ground.start, ::3] // 3
    middle = _back_door(wall, across, rng)
    if middle is not None and not blank:
        blank_bays_at_door(source[:, ground], across, middle, len(stack[-1].heights), plain, wide + 1)
    rows, columns = (np.rint(borders / pixel).astype(np.int64) for borders in (down, across))
    rows[-1], columns[-1] = size
    # An extra column behind the lattice shows bare wall.
    lattice = Lattice(style.grid.rows, style.grid.columns + bare_columns(style, plain))
    tiles = (source[0] * (wide + 2) + source[1]).astype(np.int32)
    image, labels = compose_tiles(style.image, style.labels, lattice, tiles, rows, columns, pixel / metres_per_pixel)
    plaster_bare_wall(stack, image, labels, rows, pixel)
    paint_coping(wall, stack[0], image, pixel)
    if is_front or (wall.is_corner and shows_ground_floor(style, stack[-1])):
        borders, scales = rows[ground.start : ground.stop + 1], (metres_per_pixel, pixel)
        paint_ground_units(style, wall, stack[-1], bays, image, labels, borders, scale, scales, rng)
    if middle is not None:
        paint_door(image, labels, middle, pixel, rng)
    return image, labels


def _choose_tiles(
    style: ExemplarAnalysis,
    wall: FacadeWall,
    stack: list[WallFloor],
    count: int,
    plain: int,
    rng: np.random.Generator,
    *,
    blank: bool,
) -> Int32Array:
    """Choose the tiles of a wall of `count` bays: rows and columns of the exemplar's lattice, (2, M, N)."""
    floors, wide = [wall_floor.exemplar_floor for wall_floor in stack], len(style.grid.columns) - 1
    if wall.on_street and not blank:
        variants = [
            initial_tiling(style, floors, count, False, rng, RETARGETING.price_noise * k**0.5) for k in range(4)
        ]
        tiles, _ = refine_tiling(style, floors, variants, False, rng)
    else:
        tiles = initial_tiling(style, floors, count, blank, rng, 0.0)
    source = np.stack(np.divmod(tiles, wide))
    if blank:
        source[1] = wide + 1
    elif not wall.on_street:
        row = 0
        for wall_floor in stack:  # interiors differ from floor to floor
            bays = rng.choice(_plain_bays(style, plain), count)
            source[1, row : row + len(wall_floor.heights)] = (3 * bays[:, None] + np.arange(3)).ravel()
            row += len(wall_floor.heights)
    return source


def _back_door(wall: FacadeWall, across: Float64Array, rng: np.random.Generator) -> float | None:
    """Return the middle of the door of a back with an entrance, metres from the left; None without one."""
    if not (wall.has_back_door or (wall.is_back and bool(wall.entrances) and not wall.is_raised)):
        return None
    return choose_door_position(wall.free, (wall.width, wall.height), across, wall.seams, wall.entrances, rng)


def _fit_bays(widths: Float64Array, counts: Sequence[int], ends: Sequence[float]) -> Float64Array:
    """Return the borders (3 n + 1,) of bays and of the windows in them, which fill each section of a wall, metres.

    Parameters
    ----------
    widths : (3 n,) natural widths.
    counts : bays of each section.
    ends : ends of the sections.
    """
    split = np.split(widths, 3 * np.cumsum(counts)[:-1])
    fitted = []
    for own, (left, right) in zip(split, pairwise(ends), strict=True):
        if len(own) == 3:  # a lone window is in the middle
            own[[0, 2]] = own[[0, 2]].mean()
        fitted.append(fit_sizes_to_total(own, np.tile([True, False, True], len(own) // 3), right - left))
    return np.append(0.0, np.cumsum(np.concatenate(fitted)))


def _divide_into_bays(
    style: ExemplarAnalysis, wall: FacadeWall, scale: float, more_bays: int
) -> tuple[list[float], list[int]]:
    """Return the ends of a wall's sections, metres, and their numbers of bays; none without room for a window.

    The widest section has some bays more than fit best, within the limits of piers.
    """
    bay = scale * float(np.diff(style.structure.bay_cuts).mean()) * (BAYS.back_bay_factor if wall.is_back else 1.0)
    window = scale * float(np.diff(style.structure.bays, axis=1).mean())
    least = BAYS.min_width_share * window if wall.on_street else max(0.5 * bay - 2 * BAYS.window_margin_m, window)
    if wall.width < least + 2 * BAYS.window_margin_m:
        return [0.0, wall.width], []
    ends = _wall_sections(wall, bay)
    counts = [max(1, round((right - left) / bay)) for left, right in pairwise(ends)]
    widest = int(np.argmax(np.diff(ends)))
    counts[widest] = max(1, counts[widest] + more_bays)
    if wall.on_street:
        narrow = RETARGETING.window_stretch[0] * window + RETARGETING.pier_stretch[0] * max(bay - window, 0.0)
        for k, wide in enumerate(np.diff(ends).tolist()):
            counts[k] = max(counts[k], min(math.ceil(wide / (window + BAYS.max_pier_m)), round(wide / narrow)))
        if counts == [1] and wall.floors == 1 and wall.width >= 2 * (least + 2 * BAYS.window_margin_m):
            counts = [2]  # the door of a low house has a window beside it
    return ends, counts


def _wall_sections(wall: FacadeWall, bay: float) -> list[float]:
    """Return the ends of a wall, and the seams and steps of its free part with room for whole bays between them, metres."""
    outlines = [part for part in shapely.get_parts(wall.free) if part.geom_type == "Polygon"]
    edges = [edge for part in outlines for edge in pairwise(part.exterior.coords)]
    steps = [x for (x, y), (u, v) in edges if abs(x - u) < BAYS.window_margin_m and abs(y - v) > FLOORS.min_floor_m]
    ends = [0.0]
    for seam in sorted([*wall.seams, *steps]):
        if min(seam - ends[-1], wall.width - seam) >= BAYS.min_section_bays * bay:
            ends.append(seam)
    return [*ends, wall.width]


def _move_off_seams(across: Float64Array, seams: tuple[float, ...], margin: float) -> Float64Array:
    """Move windows within their bays off seams and wall ends, by a margin in metres; they stay if there is no room.

    Parameters
    ----------
    across : (3 n + 1,) borders of bays and of the windows in them, metres.
    """
    across = across.copy()
    for left in range(0, len(across) - 1, 3):
        start, first, last, end = across[left : left + 4]
        if not any(first - margin < edge < last + margin for edge in (across[0], *seams, across[-1])):
            continue
        inner = [seam for seam in seams if start < seam < end]
        # a window across a seam would be left out: between narrow facets it gets a smaller margin
        for apart in (margin, margin / 3) if any(first < seam < last for seam in inner) else (margin,):
            places = [(a + apart, b - apart) for a, b in pairwise([start, *inner, end])]
            widths = [min(last - first, b - a) for a, b in places]
            fits = [
                (abs(x - first), x, width)
                for (a, b), width in zip(places, widths, strict=True)
                for x in [float(np.clip(first, a, b - width))]
                if width >= BAYS.min_width_share * (last - first)
            ]
            if fits:
                break
        if fits:
            _, x, width = min(fits)
            across[left + 1 : left + 3] = x, x + width
    return across


def _plain_bays(style: ExemplarAnalysis, plain: int) -> Int64Array:
    """Return the bays (k,) with the fewest balconies on the plainest floor, if possible not at the edges."""
    rows, cuts = style.grid.rows, style.structure.bay_cuts
    band = style.labels[rows[3 * plain] : rows[3 * plain + 3]] == FacadeClass.BALCONY
    adorned = np.add.reduceat(band.mean(axis=0), cuts[:-1]) / np.diff(cuts)
    plainest = np.flatnonzero(adorned <= adorned.min() + 0.002)
    inner = plainest[(plainest > 0) & (plainest < len(adorned) - 1)]
    return inner if len(inner) else plainest
