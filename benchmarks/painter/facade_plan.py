"""Layout of a painted facade: floors, and a rectangle with a kind and a state for each opening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.painter.styles import FacadeStyle
from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, FacadeClass
from facade_core.core.types import Element

WINDOW_STATES = ("clear", "curtains-open", "curtains-drawn", "blind-half", "blind-full")
WINDOW_ODDS = (0.50, 0.21, 0.06, 0.15, 0.08)
BALCONY_STATES = ("bare", "flowers")
BALCONY_ODDS = (0.85, 0.15)
SHOP_STATES = ("plain", "awning")
SHOP_ODDS = (0.65, 0.35)
# Free width between shops or balconies and the ends of a facade.
END_MARGIN_M = 0.5
# Width of the pier between two bays of shops.
PIER_WIDTH_M = 0.5
MAX_BAY_WIDTH_M = 4.2
# Height of the lowest roof band with dormers.
MIN_DORMER_ROOF_M = 1.7


@dataclass(frozen=True, slots=True)
class PaintedOpening:
    """Window, balcony, door or shop of a painted facade.

    Attributes
    ----------
    label : class name.
    kind : variant within the class, such as "dormer".
    state : such as "blind-half".
    box : x0, y0, x1, y1 in whole pixels, half-open.
    floor : floor number, 0 for the ground floor.
    column : window column.
    shop_number : number of the shop that this bay belongs to.
    """

    label: str
    kind: str
    state: str
    box: tuple[int, int, int, int]
    floor: int
    column: int
    shop_number: int = 0

    @property
    def element_state(self) -> str:
        """State with the class: 'window:blind-half', or 'window:dormer-blind-half' for another kind of window."""
        return f"{self.label}:{self.state}" if self.kind == "plain" else f"{self.label}:{self.kind}-{self.state}"


@dataclass(frozen=True, slots=True)
class FacadePlan:
    """Layout of a painted facade in pixels.

    Attributes
    ----------
    style : style of the facade.
    height, width : size of the raster.
    metres_per_pixel : resolution.
    roof, crown : heights of the roof band and of the cornice below it.
    lines : lines[f] is the row of the floor line of floor f, lines[floors] the ceiling of the top floor.
    pitch : width of a window column.
    openings : windows, balconies, doors and shops.
    """

    style: FacadeStyle
    height: int
    width: int
    metres_per_pixel: float
    roof: int
    crown: int
    lines: tuple[int, ...]
    pitch: float
    openings: tuple[PaintedOpening, ...]

    @property
    def floors(self) -> int:
        """Number of floors below the eaves."""
        return len(self.lines) - 1

    def labels(self) -> UInt8Array:
        """Return amodal class ids (H, W) uint8: elements over wall and roof in the order of ELEMENT_CLASSES."""
        labels = np.full((self.height, self.width), FacadeClass.WALL, np.uint8)
        labels[: self.roof] = FacadeClass.ROOF
        for name, value in zip(
            ELEMENT_CLASSES, (FacadeClass.WINDOW, FacadeClass.BALCONY, FacadeClass.DOOR, FacadeClass.SHOP), strict=True
        ):
            assert CLASSES[value] == name
            for opening in self.openings:
                if opening.label == name:
                    x0, y0, x1, y1 = opening.box
                    labels[y0:y1, x0:x1] = value
        return labels

    def elements(self) -> list[Element]:
        """Return the openings as elements."""
        boxes = ((o.label, [float(side) for side in o.box]) for o in self.openings)
        return [Element(label, x0, y0, x1, y1) for label, (x0, y0, x1, y1) in boxes]


def plan_facade(
    style: FacadeStyle,
    height: int,
    width: int,
    *,
    floors: int,
    columns: int,
    metres_per_pixel: float,
    rng: np.random.Generator,
) -> FacadePlan:
    """Lay out a facade.

    Parameters
    ----------
    style : style of the facade.
    height, width : size of the raster in pixels.
    floors, columns : numbers of floors and window columns.
    metres_per_pixel : resolution.
    rng : source of randomness.
    """
    mpp = metres_per_pixel

    def px(metres: float) -> int:
        return max(1, round(metres / mpp))

    height_m = height * mpp
    roof = px(min(style.roof_height, 0.19 * height_m)) if style.roof_height else 0
    crown = px(min(style.crown, 0.07 * height_m))
    storey = (height - roof - crown) / (floors - 1 + style.ground_share)
    # All upper floors have the same whole number of pixels; the ground floor takes the rest.
    rise = int(storey)
    lines = (height, *(roof + crown + rise * (floors - 1 - f) for f in range(floors)))
    pitch = width / columns

    openings: list[PaintedOpening] = []
    with_balcony = _choose_balconies(style, floors, columns, rng)
    window_w = px(min(style.window_share * pitch * mpp, style.window_widest))
    for floor in range(1, floors):
        for column in range(columns):
            state = str(rng.choice(WINDOW_STATES, p=WINDOW_ODDS))
            door = (floor, column) in with_balcony and style.glazing != "french"
            top = lines[floor + 1] + round((1 - style.window_height_share - style.sill_share) * rise)
            bottom = lines[floor] - (px(0.08) if door else round(style.sill_share * rise))
            kind = "door" if door else "arched" if style.name == "jugend" and floor == floors - 1 else "plain"
            openings.append(
                PaintedOpening("window", kind, state, _centred_box(column, pitch, window_w, top, bottom), floor, column)
            )
    openings += _place_balconies(style, with_balcony, lines, width, pitch, window_w, mpp, rng)
    openings += _place_ground_floor(style, height, lines[1], columns, pitch, window_w, mpp, rng)
    if roof * mpp >= MIN_DORMER_ROOF_M and style.roof == "mansard":
        dormer_w = px(min(0.34 * pitch * mpp, 1.05))
        for column in range(columns):
            state = str(rng.choice(WINDOW_STATES, p=WINDOW_ODDS))
            box = _centred_box(column, pitch, dormer_w, round(0.30 * roof), round(0.84 * roof))
            openings.append(PaintedOpening("window", "dormer", state, box, floors, column))
    return FacadePlan(style, height, width, mpp, roof, crown, lines, pitch, tuple(openings))


def _centred_box(column: float, pitch: float, width: int, top: int, bottom: int) -> tuple[int, int, int, int]:
    left = round((column + 0.5) * pitch - width / 2)
    return left, top, left + width, max(bottom, top + 2)


def _end_margin(width: int, mpp: float) -> int:
    """Return the pixels that shops and balconies leave free at either end of a facade."""
    return round(min(END_MARGIN_M / mpp, 0.12 * width))


def _choose_balconies(style: FacadeStyle, floors: int, columns: int, rng: np.random.Generator) -> set[tuple[int, int]]:
    upper = range(1, floors)
    if floors == 1 or style.balconies == "none":
        return set()
    if style.balconies == "parisian":
        return {(f, c) for f in upper for c in range(columns)}
    if style.balconies == "centre":
        middle = {columns // 2, (columns - 1) // 2}
        return {(1, c) for c in middle}
    first = int(rng.integers(columns))
    chosen = {first, columns - 1 - first} if columns > 2 else {first}
    if style.balconies == "stacks":
        return {(f, c) for f in upper for c in chosen}
    lowest = min(int(rng.integers(1, 3)), floors - 1)
    return {(f, c) for f in range(lowest, max(floors - 1, lowest + 1)) for c in chosen}


def _place_balconies(
    style: FacadeStyle,
    places: set[tuple[int, int]],
    lines: tuple[int, ...],
    width: int,
    pitch: float,
    window_w: int,
    mpp: float,
    rng: np.random.Generator,
) -> list[PaintedOpening]:
    floors = len(lines) - 1
    above, below, edge = round(0.95 / mpp), round(0.16 / mpp), _end_margin(width, mpp)
    found = []
    parisian = style.balconies == "parisian"
    long_floors = {min(2, floors - 1), floors - 1} if parisian and floors >= 4 else {floors - 1} if parisian else set()
    for floor, column in sorted(places):
        top, bottom = lines[floor] - above, lines[floor] + max(1, below)
        state = str(rng.choice(BALCONY_STATES, p=BALCONY_ODDS))
        if floor in long_floors:
            if column == 0:
                margin = max(1, round(0.12 * pitch), edge)
                box = (margin, top, width - margin, bottom)
                found.append(PaintedOpening("balcony", "long", state, box, floor, 0))
            continue
        share = {"solid": 0.90, "stone": 0.86}.get(style.railing, 0.0)
        margin_m = 0.12 if parisian else 0.42
        wide = round(share * pitch) if share else min(window_w + 2 * round(margin_m / mpp), round(0.94 * pitch))
        if share:
            wide = min(wide, round(3.4 / mpp))
        if column in (0, round(width / pitch) - 1):
            wide = max(min(wide, round(pitch) - 2 * edge), min(wide, window_w))
        found.append(
            PaintedOpening("balcony", "plain", state, _centred_box(column, pitch, wide, top, bottom), floor, column)
        )
    return found


def _place_ground_floor(
    style: FacadeStyle,
    height: int,
    ceiling: int,
    columns: int,
    pitch: float,
    window_w: int,
    mpp: float,
    rng: np.random.Generator,
) -> list[PaintedOpening]:
    tall = height - ceiling
    shops = rng.random() < style.shops and tall * mpp >= 2.8 and pitch * mpp >= 1.9
    doorway = columns // 2 if style.balconies == "centre" else int(rng.integers(columns))
    doorways = (
        set(range(doorway % style.columns_per_door, columns, style.columns_per_door))
        if style.columns_per_door
        else {doorway}
    )
    door_w = max(2, round((style.door_width or min(0.52 * pitch * mpp, 1.7)) / mpp))
    found = []
    units = _assign_shops(columns, doorway, rng) if shops else {}
    states = rng.choice(SHOP_STATES, columns, p=SHOP_ODDS)
    edge, pier = _end_margin(round(columns * pitch), mpp), PIER_WIDTH_M / mpp
    for column in range(columns):
        if column in doorways:
            top = ceiling + round(0.20 * tall)
            found.append(
                PaintedOpening(
                    "door",
                    "gate" if style.has_gates else "plain",
                    "leaf",
                    _centred_box(column, pitch, door_w, top, height),
                    0,
                    column,
                )
            )
        elif column in units:
            wide = min(pitch - pier, MAX_BAY_WIDTH_M / mpp)
            left = max(round((column + 0.5) * pitch - wide / 2), edge if column == 0 else 0)
            right = round((column + 0.5) * pitch + wide / 2)
            if column == columns - 1:
                right = min(right, round(columns * pitch) - edge)
            box = (left, ceiling + round(0.11 * tall), right, height)
            unit = units[column]
            found.append(PaintedOpening("shop", "plain", str(states[unit]), box, 0, column, unit))
        else:
            state = str(rng.choice(WINDOW_STATES, p=WINDOW_ODDS))
            top, bottom = (ceiling + round(share * tall) for share in style.ground_window)
            found.append(
                PaintedOpening("window", "ground", state, _centred_box(column, pitch, window_w, top, bottom), 0, column)
            )
    return found


def _assign_shops(columns: int, doorway: int, rng: np.random.Generator) -> dict[int, int]:
    """Return the shop number by column.

    A shop is two or three bays wide where the door permits it; long facades often leave their shortest place without one.
    """
    runs: list[list[int]] = []
    for side in (range(doorway), range(doorway + 1, columns)):
        left = list(side)
        while left:
            size = len(left) if len(left) <= 3 else int(rng.integers(2, 4)) if len(left) != 4 else 2
            runs.append(left[:size])
            left = left[size:]
    if len(runs) > 2 and rng.random() < 0.6:
        least = min(range(len(runs)), key=lambda i: len(runs[i]))
        del runs[least]
    return {column: unit for unit, run in enumerate(runs) for column in run}
