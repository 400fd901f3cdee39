"""Glass and bars of windows and shops in a facade's picture, and which are lit at night, as by people who live there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, FacadeClass
from facade_core.export.lighting.shop_interiors import interior
from facade_core.parsing.elements import elements

# A frame's width around panes, metres; bars are narrower than this, and so much brighter or darker than the glass beside them,
# of 255. Where more than this share of a window would be bars, its picture does not tell them.
FRAME_M, BAR_M, BRIGHTER, DARKER, MOST_BARS = 0.06, 0.16, 26, 22, 0.6
# The ground floor's upper part of a shop is its sign, and so much at its foot the wall under its panes.
SIGN, PLINTH = 0.2, 0.1
# A pane leans by at most this slope; panes of one leaf alike.
LEANS = 0.012
# A flat is so wide and high, metres. Places of windows count by steps of this, so that finer textures have the same ones lit.
FLAT_M, STOREY_M, PLACE_M = 6.5, 3.2, 0.5
# The share of flats that are lit in a house, least and most; of windows in these; of storeys where few are, and how few there.
LIT, LIT_IN_FLAT, DIM_STOREY, FEW, LIT_SHOPS = (0.3, 0.65), 0.8, 0.2, 0.3, 0.85
# Light of lamps, linear red, green and blue, and their shares: warm, warmer, neutral, cool, a screen.
LAMPS = np.array(
    [[1.0, 0.62, 0.3], [1.0, 0.52, 0.2], [1.0, 0.76, 0.5], [0.86, 0.92, 1.0], [0.35, 0.5, 0.9]], np.float32
)
SHARES = np.cumsum([0.42, 0.24, 0.18, 0.1, 0.06])
# Of a window's brightness, of 1: least, most; of the lamps of shops, and of a shop that is shut.
BRIGHT, SHOP_BRIGHT, SHUT = (0.2, 0.7), (0.5, 0.8), 0.1
# Shops have the lamps of these numbers, up to these shares.
SHOP_LAMPS, SHOP_SHARES = (0, 2, 3), (0.5, 0.88, 1.0)
# How much of a window's and of a shop's light is as bright as what its picture shows there.
SHOWS, SHOP_SHOWS = 0.3, 0.35
# Shares of lit windows with curtains at their sides, drawn, and with a blind half down.
SIDES, DRAWN, BLIND = 0.28, 0.17, 0.15


@dataclass(frozen=True)
class Opening:
    """A window or a shop on a raster: its box in texels, half-open."""

    label: int
    left: int
    top: int
    right: int
    bottom: int

    @property
    def box(self) -> tuple[slice, slice]:
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def shape(self) -> tuple[int, int]:
        return self.bottom - self.top, self.right - self.left


def squared(labels: np.ndarray) -> np.ndarray:
    """Labels (h, w) of a facade in which each element is its box, whatever its rim: a ragged one would glitter by day and be
    cut out of the light at night. What a shop hangs together with, windows and doors, is of the kind that most of it is: on
    glass a parser cannot tell them apart. What is too small to be an element stays as it is."""
    import cv2

    found = labels.copy()
    glazed = np.isin(labels, (FacadeClass.WINDOW, FacadeClass.SHOP, FacadeClass.DOOR)).astype(np.uint8)
    _, of = cv2.connectedComponents(glazed, connectivity=4, ltype=cv2.CV_32S)
    for number in np.setdiff1d(
        np.intersect1d(of[labels == FacadeClass.SHOP], of[labels != FacadeClass.SHOP]), [0]
    ).tolist():
        here = of == number
        found[here] = np.bincount(labels[here]).argmax()
    kinds = [CLASSES.index(name) for name in ELEMENT_CLASSES]
    boxes = sorted(((CLASSES.index(one.label), one) for one in elements(found)), key=lambda box: kinds.index(box[0]))
    _, of = cv2.connectedComponents(np.isin(found, kinds).astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    places = [(slice(int(one.y0), int(one.y1)), slice(int(one.x0), int(one.x1))) for _, one in boxes]
    known = np.zeros(int(of.max()) + 1, bool)
    for place in places:
        known[of[place]] = True
    known[0] = False
    found[known[of]] = FacadeClass.WALL
    for (label, _), place in zip(boxes, places, strict=True):
        found[place] = label
    return found


def openings(labels: np.ndarray) -> Iterator[Opening]:
    """The windows and shops of `squared` labels (h, w)."""
    import cv2

    taken = np.zeros(labels.shape, bool)
    for one in elements(labels):
        if one.label in ("window", "shop"):
            found = Opening(CLASSES.index(one.label), *(int(side) for side in (one.x0, one.y0, one.x1, one.y1)))
            taken[found.box] = True
            yield found
    for label in (FacadeClass.WINDOW, FacadeClass.SHOP):  # too small to be told as elements
        left = ((labels == label) & ~taken).astype(np.uint8)
        _, _, boxes, _ = cv2.connectedComponentsWithStats(left, connectivity=4, ltype=cv2.CV_32S)
        for x, y, width, height, _ in boxes[1:].tolist():
            yield Opening(label, x, y, x + width, y + height)


def glass(opening: Opening, grey: np.ndarray, density: float) -> np.ndarray:
    """Where an opening's box (h, w) is glass, bool: within a frame, between the bars that the grey (h, w) uint8 shows."""
    import cv2

    inside = np.ones(opening.shape, bool)
    height = len(inside)
    if opening.label == FacadeClass.SHOP:
        panes = _panes_of_shop(height)
        inside[: panes.start] = False
        inside[panes.stop :] = False
    frame = max(1, round(FRAME_M * density))
    eroded = cv2.erode(np.pad(inside, frame).astype(np.uint8), np.ones((2 * frame + 1,) * 2, np.uint8))
    found: np.ndarray = eroded[frame:-frame, frame:-frame] > 0
    bar = round(BAR_M * density)
    if bar < 2 or opening.label == FacadeClass.SHOP:  # too coarse to show any; a shop's goods have edges too
        return found
    part = np.ascontiguousarray(grey[opening.box])
    kernel = np.ones((bar + 1, bar + 1), np.uint8)
    bars = np.asarray(cv2.morphologyEx(part, cv2.MORPH_TOPHAT, kernel) > BRIGHTER)
    bars |= np.asarray(cv2.morphologyEx(part, cv2.MORPH_BLACKHAT, kernel) > DARKER)
    clear: np.ndarray = found & ~bars
    return clear if clear.sum() >= (1 - MOST_BARS) * found.sum() else found


def _panes_of_shop(height: int) -> slice:
    """The rows of a shop so high that are panes."""
    top = round(SIGN * height)
    return slice(top, max(top + 1, height - round(PLINTH * height)))


class Chances:
    """Numbers 0..1 by chance for whole numbers: of a building and a wall, and what else is asked for."""

    def __init__(self, building: int, wall: int) -> None:
        self._building, self._wall = building, wall

    def of_building(self, *what: int) -> float:
        return _chance(self._building, 0, *what)

    def of_wall(self, *what: int) -> float:
        return _chance(self._building, self._wall, *what)


def _chance(*numbers: int) -> float:
    """Numbers mixed after splitmix64."""
    h = 0x9E3779B97F4A7C15
    for number in numbers:
        h = (h ^ (number & 0xFFFFFFFFFFFFFFFF)) * 0xBF58476D1CE4E5B9 & 0xFFFFFFFFFFFFFFFF
        h = (h ^ (h >> 27)) * 0x94D049BB133111EB & 0xFFFFFFFFFFFFFFFF
        h ^= h >> 31
    return (h >> 11) / 2**53


def leaning(opening: Opening, density: float, chances: Chances) -> np.ndarray:
    """The slopes (2,) float32, to the right and up, that an opening's panes lean by."""
    at = _place(opening, density)
    return np.array([LEANS * (2 * chances.of_wall(*at, turn) - 1) for turn in (1, 2)], np.float32)


def _place(opening: Opening, density: float) -> tuple[int, int]:
    """The steps right and down of an opening's middle, the same at other densities but at the border of a step."""
    across, down = opening.left + opening.right, opening.top + opening.bottom
    return int(across / (2 * density * PLACE_M)), int(down / (2 * density * PLACE_M))


def glow(opening: Opening, density: float, height_m: float, chances: Chances) -> np.ndarray | None:
    """Linear light (h, w, 3) float32, 0 to 1, of an opening's box at night; None where it is dark. height_m: of the wall, whose
    foot is the ground floor's."""
    at = _place(opening, density)
    over = height_m - (opening.top + opening.bottom) / (2 * density)
    storey = int(over / STOREY_M)
    if opening.label == FacadeClass.SHOP:
        return _of_shop(opening, density, at, chances)
    high, wide = opening.shape
    x, y = ((np.arange(n, dtype=np.float32) + np.float32(0.5)) / n for n in (wide, high))
    flat = int(at[0] * PLACE_M / FLAT_M + chances.of_building(storey, 21))
    share = _between(LIT, chances.of_building(22))
    if chances.of_building(storey, 23) < DIM_STOREY:
        share *= FEW
    if chances.of_wall(flat, storey, 24) >= share or chances.of_wall(*at, 25) >= LIT_IN_FLAT:
        return None
    lamp = LAMPS[int(np.searchsorted(SHARES, chances.of_wall(flat, storey, 26)).clip(0, len(LAMPS) - 1))]
    level = _between(BRIGHT, chances.of_wall(*at, 27))
    from_lamp = ((x - (0.25 + 0.5 * chances.of_wall(*at, 28))) ** 2)[None] * 2 + ((y - 0.2) ** 2)[:, None] * 1.6
    light = level * (0.35 + 0.65 * np.exp(-2 * from_lamp))
    curtain = chances.of_wall(*at, 29)
    if curtain < SIDES:
        light = light * np.where(np.abs(x - 0.5) > 0.5 - 0.16 - 0.1 * chances.of_wall(*at, 30), 0.45, 1.0)
    elif curtain < SIDES + DRAWN:
        folds = 0.85 + 0.15 * np.cos(2 * np.pi * (4 * x + chances.of_wall(*at, 30)))
        light = 0.5 * level * (0.7 + 0.3 * light / level) * folds
        lamp = lamp * np.array([1.0, 0.88, 0.74], np.float32)
    elif curtain < SIDES + DRAWN + BLIND:
        light = light * np.where(y < 0.25 + 0.4 * chances.of_wall(*at, 30), 0.4, 1.0)[:, None]
    return (light[..., None] * lamp).astype(np.float32)


def _of_shop(opening: Opening, density: float, at: tuple[int, int], chances: Chances) -> np.ndarray:
    """The same of a shop: its panes, as bright as its lamps are and what they fall on."""
    high, wide = opening.shape
    shop = int(at[0] * PLACE_M / (2 * FLAT_M))  # windows of one shop side by side
    level = _between(SHOP_BRIGHT, chances.of_wall(shop, 12)) if chances.of_wall(shop, 11) < LIT_SHOPS else SHUT
    lamp = LAMPS[SHOP_LAMPS[int(np.searchsorted(SHOP_SHARES, chances.of_wall(shop, 13)))]]
    panes = _panes_of_shop(high)
    within = (panes.stop - panes.start, wide)
    shows = interior(within, density, chances.of_wall(shop, 14), lambda *what: chances.of_wall(*at, *what))
    light = np.zeros((high, wide, 3), np.float32)
    light[panes] = np.minimum(level * lamp * shows, 1)
    return light


def through(opening: Opening, light: np.ndarray, grey: np.ndarray, clear: np.ndarray) -> np.ndarray:
    """A light (h, w, 3) of an opening's box as what hangs and stands behind its panes lets it through: by the grey (h, w) of
    the raster, of the mean where it is `clear` (h, w)."""
    if not clear.any():
        return light
    part = grey[opening.box].astype(np.float32)
    share = SHOP_SHOWS if opening.label == FacadeClass.SHOP else SHOWS
    relative = np.clip(part / max(float(part[clear].mean()), 1.0), 0.2, 1.8)
    return (light * (1 - share + share * relative)[..., None]).astype(np.float32)


def _between(ends: tuple[float, float], share: float) -> float:
    return ends[0] + (ends[1] - ends[0]) * share
