"""Painter of one facade with its ground truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.painter import entrances, materials, ornament, railings, shops
from benchmarks.painter.canvas import GAMMA, Canvas, hex_to_linear
from benchmarks.painter.canvas_light import shade_canvas
from benchmarks.painter.facade_plan import FacadePlan, PaintedOpening, plan_facade
from benchmarks.painter.library_styles import LIBRARY_STYLES
from benchmarks.painter.occluders import paint_occluders
from benchmarks.painter.styles import STYLE_BY_NAME
from benchmarks.painter.weather import apply_weathering
from benchmarks.painter.windows import (
    HIGH_FLOOR_SKY_PROBABILITY,
    LOW_FLOOR_SKY_PROBABILITY,
    WindowColours,
    paint_window_tile,
    vary_pane_brightness,
)
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import LayoutError
from facade_core.core.types import Element

MIN_FLOOR_HEIGHT_M = 2.4
MIN_COLUMN_WIDTH_M = 1.5
MIN_METRES_PER_PIXEL = 0.01
MAX_METRES_PER_PIXEL = 0.2
MAX_PIXELS = 12_000_000
ROOM_VARIANTS = 4  # rooms painted per window state and size
# Linear light that glass and air add to the darkest gap: 24 of 255. No texel of a wall is black.
MIN_LINEAR_LIGHT = np.float32((24 / 255) ** GAMMA)
# Styles that can be painted; new ones come last, as a style's number is part of the seed.
PAINTED_STYLES = STYLE_BY_NAME | {style.name: style for style in LIBRARY_STYLES}
_CURTAINS = ("#ece4d2", "#d9b98a", "#b9694c", "#9aa98c", "#e6d3c4", "#f2eee4")
_BLINDS = ("#e6e0d0", "#d8cdb4", "#c9b48c", "#dfe2e0")


@dataclass(frozen=True, slots=True)
class PaintedFacade:
    """Painted facade and its ground truth.

    Attributes
    ----------
    image : (H, W, 3) uint8 RGB.
    labels : (H, W) uint8 amodal class ids of `facade_core.core.labels`, without sky: the facade fills the raster.
    elements : exact rectangles in whole pixels, half-open, painted in the order of `labels.ELEMENT_CLASSES`.
    occluded : (H, W) bool, True where an occluder hides the facade.
    element_states : state of each element, such as "window:blind-half".
    metres_per_pixel : resolution.
    floors : number of floors below the eaves, with the ground floor.
    columns : number of window columns.
    """

    image: UInt8Array
    labels: UInt8Array
    elements: list[Element]
    occluded: BoolArray
    element_states: list[str]
    metres_per_pixel: float
    floors: int
    columns: int


def paint_facade(
    size_m: tuple[float, float],
    *,
    floors: int,
    columns: int,
    style: str,
    metres_per_pixel: float = 0.05,
    seed: int,
    occluders: int = 0,
) -> PaintedFacade:
    """Paint a facade with its ground truth.

    Parameters
    ----------
    size_m : height and width in metres.
    floors : number of floors below the eaves; a roof band with dormers is added above, inside the same height.
    columns : number of window columns.
    style : name of the style.
    metres_per_pixel : resolution.
    seed : seed of the facade.
    occluders : number of trees, cars and lamp posts in front; objects that would raise the hidden share above 40 %
        are left out.

    Raises
    ------
    LayoutError
        The size, a count or the style cannot be painted.
    """
    height, width = _validate_size(size_m, floors, columns, style, metres_per_pixel, seed, occluders)
    rng = np.random.default_rng([seed, list(PAINTED_STYLES).index(style), floors, columns])
    plan = plan_facade(
        PAINTED_STYLES[style], height, width, floors=floors, columns=columns, metres_per_pixel=metres_per_pixel, rng=rng
    )
    canvas = _paint_canvas(plan, rng)
    small = cv2.resize(shade_canvas(canvas), (width, height), interpolation=cv2.INTER_AREA)
    image = np.round(255 * np.clip(small, MIN_LINEAR_LIGHT, 1) ** np.float32(1 / GAMMA)).astype(np.uint8)
    image, occluded = paint_occluders(image, metres_per_pixel, occluders, np.random.default_rng([seed, 0x0CC]))
    states = [opening.element_state for opening in plan.openings]
    return PaintedFacade(image, plan.labels(), plan.elements(), occluded, states, metres_per_pixel, floors, columns)


def _validate_size(
    size_m: tuple[float, float], floors: int, columns: int, style: str, mpp: float, seed: int, occluders: int
) -> tuple[int, int]:
    """Check the arguments of `paint_facade` and return height and width in pixels."""
    if style not in PAINTED_STYLES:
        raise LayoutError(f"facade style {style!r} is not known; use one of {', '.join(PAINTED_STYLES)}")
    if len(size_m) != 2 or not all(math.isfinite(s) and s > 0 for s in size_m):
        raise LayoutError(f"facade size_m {size_m!r} must be (height, width), two positive numbers of metres")
    for name, count, least in (("floors", floors, 1), ("columns", columns, 1), ("occluders", occluders, 0)):
        if not isinstance(count, int | np.integer) or count < least:
            raise LayoutError(f"facade {name} is {count!r}; use a whole number of at least {least}")
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise LayoutError(f"facade seed is {seed!r}; use a whole number of at least 0")
    if not MIN_METRES_PER_PIXEL <= mpp <= MAX_METRES_PER_PIXEL:
        raise LayoutError(
            f"facade metres_per_pixel is {mpp!r}; use a value from {MIN_METRES_PER_PIXEL} to {MAX_METRES_PER_PIXEL}"
        )
    if size_m[0] < MIN_FLOOR_HEIGHT_M * floors:
        raise LayoutError(
            f"facade of {size_m[0]:g} m has no room for {floors} floors; give {MIN_FLOOR_HEIGHT_M} m to each"
        )
    if size_m[1] < MIN_COLUMN_WIDTH_M * columns:
        raise LayoutError(
            f"facade of {size_m[1]:g} m has no room for {columns} columns; give {MIN_COLUMN_WIDTH_M} m to each"
        )
    height, width = round(size_m[0] / mpp), round(size_m[1] / mpp)
    if height * width > MAX_PIXELS:
        raise LayoutError(f"facade of {height} x {width} pixels is too large to paint; use a coarser metres_per_pixel")
    return height, width


def _paint_canvas(plan: FacadePlan, rng: np.random.Generator) -> Canvas:
    style, mpp = plan.style, plan.metres_per_pixel
    # Supersampled so that fine detail has pixels of about 1.7 cm.
    factor = min(4, max(2 if mpp > 0.0167 else 1, round(mpp / 0.0167)))
    canvas = Canvas.blank(plan.height * factor, plan.width * factor, factor / mpp)
    palette = ornament.FacadePalette(
        *(
            hex_to_linear(str(rng.choice(colours))) if colours else hex_to_linear("#888888")
            for colours in (
                style.wall_colours,
                style.trim_colours,
                style.base_colours,
                style.door_colours,
                style.roof_colours,
            )
        )
    )
    frame, curtain, blind = (hex_to_linear(str(rng.choice(c))) for c in (style.frame_colours, _CURTAINS, _BLINDS))
    if style.is_workplace:
        curtain = blind = hex_to_linear("#c4cacb")
    _paint_walls(canvas, plan, palette, rng)
    ledges = ornament.paint_courses_quoins_plinth(canvas, plan, palette)
    ornament.paint_crown(canvas, plan, palette)
    _paint_openings(canvas, plan, palette, WindowColours(frame, curtain, blind), rng)
    sills = [
        (o.box[0] * mpp - 0.1, o.box[2] * mpp + 0.1, o.box[3] * mpp + 0.1)
        for o in plan.openings
        if o.label in ("window", "balcony")
    ]
    apply_weathering(canvas, sills, [y + 0.12 for y in ledges], rng)
    return canvas


def _paint_walls(canvas: Canvas, plan: FacadePlan, palette: ornament.FacadePalette, rng: np.random.Generator) -> None:
    style, mpp, w = plan.style, plan.metres_per_pixel, canvas.width_m
    top, ground, bottom = plan.roof * mpp, plan.lines[1] * mpp, plan.lines[0] * mpp
    # A course narrower than two and a half pixels would be lost, or beat against the raster.
    course = max(0.075, 2.5 * mpp)
    upper = (0.0, top, w, bottom if style.base == "wall" else max(ground, top + mpp))
    if style.wall == "brick":
        bond = materials.MasonryBond(course, 3.33 * course, 0.14 * course, header=1.67 * course, spread=0.15)
        materials.paint_masonry(canvas, upper, palette.wall, hex_to_linear("#a59380"), bond, rng)
    elif style.wall == "ashlar":
        bond = materials.MasonryBond(0.42, 1.0, 0.02, spread=0.035)
        materials.paint_masonry(canvas, upper, palette.wall, palette.wall * 0.62, bond, rng)
    elif style.wall == "panels":
        lines = [y * mpp for y in plan.lines]
        joints = np.arange(1, round(plan.width / plan.pitch)) * plan.pitch * mpp
        materials.paint_panels(canvas, upper, palette.wall, rng, joints.tolist(), lines[1:])
    elif style.wall in ("ribs", "boards"):
        materials.paint_profiled_sheets(canvas, upper, palette.wall, rng, is_level=style.wall == "boards")
    else:
        rough = {"jugend": 0.9, "functionalist": 0.35, "classicism": 0.5, "post-war": 1.0}.get(style.name, 0.2)
        materials.paint_plaster(canvas, upper, palette.wall, rng, rough=rough)
    lower = (0.0, ground, w, bottom)
    if style.base == "wall":
        pass
    elif style.base == "banded":
        materials.paint_rustication(canvas, lower, palette.base, rng, course=0.46)
    elif style.base == "granite":
        bond = materials.MasonryBond(0.48, 1.0, 0.035, header=0.6, spread=0.09)
        materials.paint_masonry(
            canvas, lower, palette.base, palette.base * 0.55, bond, rng, relief=0.06, groove=0.05, rock_face=0.035
        )
    elif style.base == "tile":
        bond = materials.MasonryBond(max(0.10, 2.5 * mpp), max(0.2, 5 * mpp), 0.014, spread=0.07)
        materials.paint_masonry(canvas, lower, palette.base, palette.base * 1.6, bond, rng, relief=0.02)
    else:
        bond = materials.MasonryBond(0.50, 1.1, 0.025, spread=0.05)
        materials.paint_masonry(canvas, lower, palette.base, palette.base * 0.6, bond, rng, relief=0.04, groove=0.02)
    if style.roof == "mansard":
        materials.paint_slate(canvas, (0.0, 0.0, w, top), rng, max(0.2, 3 * mpp))
        canvas.add_moulding(0, 0, w, 0.22, palette.roof * 0.8, (0.12, 0.16, 0.12, 0.04))
        canvas.add_moulding(0, top - 0.16, w, top, palette.roof * 0.9, (0.20, 0.30, 0.34))
    elif style.roof == "metal":
        materials.paint_sheet_metal(canvas, (0.0, 0.0, w, top), palette.roof, rng)
        canvas.add_moulding(0, top - 0.14, w, top, palette.roof * 0.8, (0.35, 0.52, 0.55))


def _paint_openings(
    canvas: Canvas, plan: FacadePlan, palette: ornament.FacadePalette, fabrics: WindowColours, rng: np.random.Generator
) -> None:
    mpp, style = plan.metres_per_pixel, plan.style
    factor = round(canvas.scale * mpp)
    tiles: dict[tuple[str, str, tuple[int, int], bool, int], tuple[Canvas, BoolArray | None]] = {}

    def metres(o: PaintedOpening) -> ornament.Box:
        x0, y0, x1, y1 = o.box
        return x0 * mpp, y0 * mpp, x1 * mpp, y1 * mpp

    def shape(o: PaintedOpening) -> tuple[int, int]:
        return (o.box[3] - o.box[1]) * factor, (o.box[2] - o.box[0]) * factor

    by_label = {name: [o for o in plan.openings if o.label == name] for name in ("window", "balcony", "door", "shop")}
    for o in by_label["window"]:
        ornament.paint_window_surround(canvas, plan, o, metres(o), palette)
    for o in by_label["window"]:
        # Several rooms per state, so that neighbouring curtains differ.
        high = 2 * o.floor > plan.floors
        key = (o.kind, o.state, shape(o), high, int(rng.integers(ROOM_VARIANTS)))
        if key not in tiles:
            sky = HIGH_FLOOR_SKY_PROBABILITY if high or style.glazing == "curtain" else LOW_FLOOR_SKY_PROBABILITY
            tiles[key] = paint_window_tile(shape(o), canvas.scale, style.glazing, o.kind, o.state, fabrics, sky, rng)
        tile, opening = tiles[key]
        canvas.paste(vary_pane_brightness(tile, rng), o.box[0] * factor, o.box[1] * factor, opening)
    spacing = factor * max(2, round(0.13 / mpp))
    parapet = 0.6 * palette.wall + 0.4 * hex_to_linear("#e4e2dc")
    for o in by_label["balcony"]:
        box = metres(o)
        if o.kind == "long":
            railings.paint_brackets(
                canvas, np.arange(1, plan.width / plan.pitch - 0.5) * plan.pitch * mpp, box[3], palette.trim
            )
        elif style.railing != "solid" and style.balconies != "parisian":
            railings.paint_brackets(canvas, np.array([box[0] + 0.2, box[2] - 0.2]), box[3], palette.trim)
        railings.paint_balcony(canvas, box, style.railing, o.state, palette.trim, parapet, rng, spacing=spacing)
    for o in by_label["door"]:
        if o.kind == "gate":
            tile = entrances.paint_gate_tile(shape(o), canvas.scale, palette.door, rng=rng)
        else:
            ornament.paint_door_surround(canvas, plan, metres(o), palette)
            tile = entrances.paint_door_tile(shape(o), canvas.scale, palette.door, is_modern=style.is_modern, rng=rng)
        canvas.paste(tile, o.box[0] * factor, o.box[1] * factor)
    bays = by_label["shop"]
    ornament.paint_shop_pilasters(canvas, plan, [metres(o) for o in bays], palette)
    numbers = sorted({o.shop_number for o in bays})
    for number, shop in zip(numbers, shops.design_shops(len(numbers), rng), strict=True):
        shop_bays = [o for o in bays if o.shop_number == number]
        for place, o in enumerate(shop_bays):
            # The first bay has the name, the second the door.
            has_name, has_door = place == 0, place == min(1, len(shop_bays) - 1)
            tile, awning = shops.paint_shop_bay_tile(
                shape(o), canvas.scale, o.state, shop, has_name=has_name, has_door=has_door, stone=palette.base, rng=rng
            )
            canvas.paste(tile, o.box[0] * factor, o.box[1] * factor)
            if awning is not None:
                x, y = o.box[0] * factor + awning.x, o.box[1] * factor + awning.y
                canvas.plates.append(replace(awning, x=x, y=y))
