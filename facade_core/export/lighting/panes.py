"""Glass panes of windows and shops in a facade picture, and their light at night."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, FacadeClass
from facade_core.export.lighting.settings import PANES
from facade_core.export.lighting.shop_interiors import shop_interior_light
from facade_core.parsing.elements import elements

# Linear RGB of lamps: warm, warmer, neutral, cool, a screen.
LAMP_COLOURS = np.array(
    [[1.0, 0.62, 0.3], [1.0, 0.52, 0.2], [1.0, 0.76, 0.5], [0.86, 0.92, 1.0], [0.35, 0.5, 0.9]], np.float32
)
# Cumulative shares of the lamps.
LAMP_CUMULATIVE_SHARES = np.cumsum([0.42, 0.24, 0.18, 0.1, 0.06])


@dataclass(frozen=True)
class FacadeOpening:
    """Window or shop on a raster, a half-open box in texels."""

    label: int
    left: int
    top: int
    right: int
    bottom: int

    @property
    def box(self) -> tuple[slice, slice]:
        """Return the rows and columns of the opening as slices."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def shape(self) -> tuple[int, int]:
        """Return height and width in texels."""
        return self.bottom - self.top, self.right - self.left


def snap_to_boxes(labels: UInt8Array) -> UInt8Array:
    """Replace each element of a label map by its bounding box.

    Ragged borders would glitter by day and cut the light at night. A shop merges with the windows and doors connected to it
    and takes their majority class, because a parser cannot separate them on glass. Elements that are too small stay.

    Parameters
    ----------
    labels : (h, w) facade classes.

    Returns
    -------
    (h, w) facade classes.
    """
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


def find_openings(labels: UInt8Array) -> Iterator[FacadeOpening]:
    """Find the windows and shops in labels (h, w) of `snap_to_boxes`."""
    taken = np.zeros(labels.shape, bool)
    for one in elements(labels):
        if one.label in ("window", "shop"):
            found = FacadeOpening(CLASSES.index(one.label), *(int(side) for side in (one.x0, one.y0, one.x1, one.y1)))
            taken[found.box] = True
            yield found
    for label in (FacadeClass.WINDOW, FacadeClass.SHOP):  # too small to be told as elements
        left = ((labels == label) & ~taken).astype(np.uint8)
        _, _, boxes, _ = cv2.connectedComponentsWithStats(left, connectivity=4, ltype=cv2.CV_32S)
        for x, y, width, height, _ in boxes[1:].tolist():
            yield FacadeOpening(label, x, y, x + width, y + height)


def glass_mask(opening: FacadeOpening, grey: UInt8Array, density: float) -> BoolArray:
    """Compute the mask of glass in an opening: inside its frame, between the bars visible in the picture.

    Parameters
    ----------
    opening : the window or shop.
    grey : (h, w) uint8 picture of the facade.
    density : texels per metre.

    Returns
    -------
    (h, w) bool over the box of the opening.
    """
    inside = np.ones(opening.shape, bool)
    height = len(inside)
    if opening.label == FacadeClass.SHOP:
        panes = _shop_pane_rows(height)
        inside[: panes.start] = False
        inside[panes.stop :] = False
    frame = max(1, round(PANES.pane_frame_m * density))
    eroded = cv2.erode(np.pad(inside, frame).astype(np.uint8), np.ones((2 * frame + 1,) * 2, np.uint8))
    found: BoolArray = eroded[frame:-frame, frame:-frame] > 0
    bar = round(PANES.max_bar_m * density)
    if bar < 2 or opening.label == FacadeClass.SHOP:  # too coarse to show any; a shop's goods have edges too
        return found
    part = np.ascontiguousarray(grey[opening.box])
    kernel = np.ones((bar + 1, bar + 1), np.uint8)
    bars = np.asarray(cv2.morphologyEx(part, cv2.MORPH_TOPHAT, kernel) > PANES.min_brighter)
    bars |= np.asarray(cv2.morphologyEx(part, cv2.MORPH_BLACKHAT, kernel) > PANES.min_darker)
    clear: BoolArray = found & ~bars
    return clear if clear.sum() >= (1 - PANES.max_bar_share) * found.sum() else found


def _shop_pane_rows(height: int) -> slice:
    """Return the rows of a shop's panes, below its sign and above its plinth."""
    top = round(PANES.shop_sign_share * height)
    return slice(top, max(top + 1, height - round(PANES.shop_plinth_share * height)))


class SeededRandom:
    """Uniform numbers 0 to 1 for integer keys, seeded by building and wall."""

    def __init__(self, building: int, wall: int) -> None:
        self._building, self._wall = building, wall

    def per_building(self, *what: int) -> float:
        """Return the number of integer keys that all walls of the building share."""
        return _hash_splitmix64(self._building, 0, *what)

    def per_wall(self, *what: int) -> float:
        """Return the number of integer keys on this wall."""
        return _hash_splitmix64(self._building, self._wall, *what)


def _hash_splitmix64(*numbers: int) -> float:
    """Hash integers to 0 to 1 with splitmix64."""
    h = 0x9E3779B97F4A7C15
    for number in numbers:
        h = (h ^ (number & 0xFFFFFFFFFFFFFFFF)) * 0xBF58476D1CE4E5B9 & 0xFFFFFFFFFFFFFFFF
        h = (h ^ (h >> 27)) * 0x94D049BB133111EB & 0xFFFFFFFFFFFFFFFF
        h ^= h >> 31
    return (h >> 11) / 2**53


def pane_slope(opening: FacadeOpening, density: float, random: SeededRandom) -> Float32Array:
    """Return the slopes (2,) float32 to the right and up of an opening's panes."""
    at = _opening_place(opening, density)
    return np.array([PANES.max_pane_slope * (2 * random.per_wall(*at, turn) - 1) for turn in (1, 2)], np.float32)


def _opening_place(opening: FacadeOpening, density: float) -> tuple[int, int]:
    """Return the position of an opening's centre in steps right and down, stable across densities except at step borders."""
    across, down = opening.left + opening.right, opening.top + opening.bottom
    return int(across / (2 * density * PANES.place_step_m)), int(down / (2 * density * PANES.place_step_m))


def opening_emission(
    opening: FacadeOpening, density: float, height_m: float, random: SeededRandom
) -> Float32Array | None:
    """Compute the light of an opening at night.

    Parameters
    ----------
    opening : the window or shop.
    density : texels per metre.
    height_m : height of the wall, whose foot is at the ground floor.
    random : numbers of the building and wall.

    Returns
    -------
    (h, w, 3) float32 linear 0 to 1 over the box of the opening; None where dark.
    """
    at = _opening_place(opening, density)
    over = height_m - (opening.top + opening.bottom) / (2 * density)
    storey = int(over / PANES.floor_height_m)
    if opening.label == FacadeClass.SHOP:
        return _shop_light(opening, density, at, random)
    high, wide = opening.shape
    x, y = ((np.arange(n, dtype=np.float32) + np.float32(0.5)) / n for n in (wide, high))
    flat = int(at[0] * PANES.place_step_m / PANES.flat_width_m + random.per_building(storey, 21))
    share = _interpolate(PANES.lit_flat_share_range, random.per_building(22))
    if random.per_building(storey, 23) < PANES.dim_floor_share:
        share *= PANES.dim_floor_factor
    if random.per_wall(flat, storey, 24) >= share or random.per_wall(*at, 25) >= PANES.lit_window_share:
        return None
    lamp = LAMP_COLOURS[
        int(np.searchsorted(LAMP_CUMULATIVE_SHARES, random.per_wall(flat, storey, 26)).clip(0, len(LAMP_COLOURS) - 1))
    ]
    level = _interpolate(PANES.window_light_range, random.per_wall(*at, 27))
    from_lamp = ((x - (0.25 + 0.5 * random.per_wall(*at, 28))) ** 2)[None] * 2 + ((y - 0.2) ** 2)[:, None] * 1.6
    light = level * (0.35 + 0.65 * np.exp(-2 * from_lamp))
    curtain = random.per_wall(*at, 29)
    if curtain < PANES.side_curtain_share:
        light = light * np.where(np.abs(x - 0.5) > 0.5 - 0.16 - 0.1 * random.per_wall(*at, 30), 0.45, 1.0)
    elif curtain < PANES.side_curtain_share + PANES.drawn_curtain_share:
        folds = 0.85 + 0.15 * np.cos(2 * np.pi * (4 * x + random.per_wall(*at, 30)))
        light = 0.5 * level * (0.7 + 0.3 * light / level) * folds
        lamp = lamp * np.array([1.0, 0.88, 0.74], np.float32)
    elif curtain < PANES.side_curtain_share + PANES.drawn_curtain_share + PANES.blind_share:
        light = light * np.where(y < 0.25 + 0.4 * random.per_wall(*at, 30), 0.4, 1.0)[:, None]
    emission: Float32Array = (light[..., None] * lamp).astype(np.float32)
    return emission


def _shop_light(opening: FacadeOpening, density: float, at: tuple[int, int], random: SeededRandom) -> Float32Array:
    """Return the light of a shop's panes."""
    high, wide = opening.shape
    shop = int(at[0] * PANES.place_step_m / (2 * PANES.flat_width_m))  # windows of one shop side by side
    level = (
        _interpolate(PANES.shop_light_range, random.per_wall(shop, 12))
        if random.per_wall(shop, 11) < PANES.lit_shop_share
        else PANES.closed_shop_light
    )
    lamp = LAMP_COLOURS[
        PANES.shop_lamps[int(np.searchsorted(PANES.shop_lamp_cumulative_shares, random.per_wall(shop, 13)))]
    ]
    panes = _shop_pane_rows(high)
    within = (panes.stop - panes.start, wide)
    shows = shop_interior_light(within, density, random.per_wall(shop, 14), lambda *what: random.per_wall(*at, *what))
    light = np.zeros((high, wide, 3), np.float32)
    light[panes] = np.minimum(level * lamp * shows, 1)
    return light


def modulate_by_picture(
    opening: FacadeOpening, light: Float32Array, grey: UInt8Array, clear: BoolArray
) -> Float32Array:
    """Modulate the light of an opening by the picture behind its panes.

    Parameters
    ----------
    opening : the window or shop.
    light : (h, w, 3) light over the box of the opening.
    grey : (h, w) picture of the facade.
    clear : (h, w) bool glass in the box; its mean brightness is the reference.

    Returns
    -------
    (h, w, 3) float32.
    """
    if not clear.any():
        return light
    part = grey[opening.box].astype(np.float32)
    share = PANES.shop_picture_share if opening.label == FacadeClass.SHOP else PANES.window_picture_share
    relative = np.clip(part / max(float(part[clear].mean()), 1.0), 0.2, 1.8)
    modulated: Float32Array = (light * (1 - share + share * relative)[..., None]).astype(np.float32)
    return modulated


def _interpolate(ends: tuple[float, float], share: float) -> float:
    return ends[0] + (ends[1] - ends[0]) * share
