"""Judgement of an exemplar before walls are made from it: one score with its parts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import prod

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_with_labels
from facade_core.parsing.floor_structure import FloorsAndBays, find_floors_and_bays

# Pixels a metre at which pictures are compared; a coarser picture is blurred at it.
JUDGED_PIXELS_PER_METRE = 16.0
# Share of the gradient energy that a slight blur takes from a sharp picture, and from one without detail.
SHARP_LOSS = 0.6
BLURRED_LOSS = 0.2
# Distance in CIELAB's a and b from the wall's median at which a pixel of wall shows something else, such as a tree or sign.
FOREIGN_CHROMA = 18.0
# Share of such pixels, slope of window columns, and share of shadow with which an exemplar is worth nothing.
MAX_FOREIGN_SHARE = 0.3
MAX_SLOPE = 0.08
MAX_SHADED_SHARE = 0.8
# Least light of all bands of a burnt-out pixel, and share of the wall's pixels with which an exemplar is worth nothing.
BURNT_OUT = 250
MAX_BURNT_SHARE = 0.3
# Share of shadow that a wall in even light has at most.
USUAL_SHADED_SHARE = 0.18
# Smallest share of a window's place in the grid of floors and bays that it fills.
MIN_FILLED_SHARE = 0.4
# Least height of an entrance, metres.
MIN_ENTRANCE_M = 1.5
# Lightness relative to the wall of the upper floors below which wall of the ground floor is in deep shadow or hidden.
DARK_FOOT = 0.4
# Worth of an exemplar whose part is worth nothing; otherwise one bad part would hide the others.
_FLOOR = 0.1


@dataclass(frozen=True)
class ExemplarQuality:
    """Parts of a judgement, each from 0 (useless) to 1.

    Attributes
    ----------
    sharpness : detail at JUDGED_PIXELS_PER_METRE.
    upper, foot : shares of the upper floors and of the ground floor that the picture shows, not inpainted; the latter times
        the share of its wall that is not dark. A ground floor without an entrance is cut off by the picture.
    clean : few pixels of wall in colours foreign to it, as of remaining trees and signs.
    whole : share of the grid of floors and bays with a window.
    light : little of the wall in shadow or burnt out.
    straight : columns of windows are upright.
    """

    sharpness: float
    upper: float
    foot: float
    clean: float
    whole: float
    light: float
    straight: float

    @property
    def body(self) -> float:
        """Return the product of all parts but the ground floor, 0 to 1."""
        return prod(max(_FLOOR, part) for name, part in asdict(self).items() if name != "foot")

    @property
    def ground_floor(self) -> float:
        """Return how well the ground floor is seen, 0 to 1: under other floors a blurred one looks smeared."""
        return self.foot * self.sharpness

    @property
    def score(self) -> float:
        """Return the product of all parts, 0 to 1."""
        return self.body * max(_FLOOR, self.foot)


def judge_exemplar(
    image: UInt8Array, labels: UInt8Array, hidden: BoolArray, metres_per_pixel: float, shaded_share: float
) -> ExemplarQuality:
    """Judge a prepared exemplar.

    Parameters
    ----------
    image : (h, w, 3) uint8, completed.
    labels : (h, w) uint8 class ids, completed.
    hidden : (h, w) bool, inpainted pixels.
    metres_per_pixel : scale of the picture.
    shaded_share : share of its wall in shadow.
    """
    size = tuple(max(8, round(side * metres_per_pixel * JUDGED_PIXELS_PER_METRE)) for side in labels.shape)
    small, classes = resize_with_labels(image, labels, (size[0], size[1]))
    unseen = np.asarray(cv2.resize(hidden.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST)) > 0
    found = find_floors_and_bays(classes)
    ground = found.ground_top if found is not None else size[0]
    whole, slope = (_grid_completeness(classes, found), _column_slope(classes, found)) if found else (0.0, 0.0)
    return ExemplarQuality(
        sharpness=_limit((_blur_loss(small, ~unseen) - BLURRED_LOSS) / (SHARP_LOSS - BLURRED_LOSS)),
        upper=_limit(1 - _share(unseen[:ground])),
        foot=_limit((1 - _share(unseen[ground:])) * (1 - _dark_share(small, classes, ground)))
        if _has_entrance(classes[ground:])
        else 0.0,
        clean=_limit(1 - _foreign_share(small, classes) / MAX_FOREIGN_SHARE),
        whole=whole,
        light=_limit(1 - max(shaded_share / MAX_SHADED_SHARE, _burnt_share(small, classes) / MAX_BURNT_SHARE)),
        straight=_limit(1 - slope / MAX_SLOPE),
    )


def _has_entrance(labels: UInt8Array) -> bool:
    """Return whether a ground floor at JUDGED_PIXELS_PER_METRE shows a door or a shop."""
    tall = np.isin(labels, (FacadeClass.DOOR, FacadeClass.SHOP)).sum(axis=0)
    return bool((tall >= MIN_ENTRANCE_M * JUDGED_PIXELS_PER_METRE).any())


def _dark_share(image: UInt8Array, labels: UInt8Array, ground: int) -> float:
    """Return the share of dark wall below a row, which is the top of the ground floor; 0 without wall."""
    light, wall = cv2.cvtColor(image, cv2.COLOR_RGB2LAB)[..., 0], labels == FacadeClass.WALL
    if not (wall[:ground].any() and wall[ground:].any()):
        return 0.0
    return _share(light[ground:][wall[ground:]] < DARK_FOOT * float(np.median(light[:ground][wall[:ground]])))


def _burnt_share(image: UInt8Array, labels: UInt8Array) -> float:
    """Return the share of the wall's pixels that are burnt out."""
    return _share(image[labels == FacadeClass.WALL].min(axis=1) >= BURNT_OUT)


def _limit(value: float) -> float:
    return round(float(np.clip(value, 0.0, 1.0)), 3)


def _share(mask: BoolArray) -> float:
    return float(mask.mean()) if mask.size else 0.0


def _blur_loss(image: UInt8Array, seen: BoolArray) -> float:
    """Return the share of the gradient energy of visible pixels that a slight blur takes."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float64)
    blurred = np.asarray(cv2.GaussianBlur(grey, (0, 0), 1.0), np.float64)
    before, after = _gradient_energy(grey, seen), _gradient_energy(blurred, seen)
    return 1 - after / before if before > 0 else 0.0


def _gradient_energy(grey: Float64Array, seen: BoolArray) -> float:
    return sum(float((np.gradient(grey, axis=axis)[seen] ** 2).sum()) for axis in (0, 1))


def _foreign_share(image: UInt8Array, labels: UInt8Array) -> float:
    """Return the share of the wall's pixels whose hue is not that of the wall."""
    wall = labels == FacadeClass.WALL
    if not wall.any():
        return 1.0
    chroma = cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)[..., 1:]
    off = np.linalg.norm(chroma[wall] - np.median(chroma[wall], axis=0), axis=1)
    return float((off > FOREIGN_CHROMA).mean())


def _grid_completeness(labels: UInt8Array, found: FloorsAndBays) -> float:
    """Return the share of the places in the grid of upper floors and bays that a window fills."""
    window = labels == FacadeClass.WINDOW
    floors = [span for span, kind in zip(found.floors, found.kinds, strict=True) if kind == "middle"]
    filled = [window[a:b, left:right].mean() >= MIN_FILLED_SHARE for a, b in floors for left, right in found.bays]
    return round(float(np.mean(filled)), 3)


def _column_slope(labels: UInt8Array, found: FloorsAndBays) -> float:
    """Return the median slope of the columns of windows against the vertical; 0 with less than three floors."""
    window = labels == FacadeClass.WINDOW
    if len(found.floors) < 3:
        return 0.0
    slopes = []
    for left, right in zip(found.bay_cuts[:-1], found.bay_cuts[1:], strict=True):
        places = [
            ((a + b) / 2, np.flatnonzero(window[a:b, left:right].any(axis=0)).mean())
            for a, b in found.floors
            if window[a:b, left:right].any()
        ]
        if len(places) >= 3:
            down, across = np.array(places, np.float64).T
            down -= down.mean()
            slopes.append(abs(float((down * (across - across.mean())).sum() / (down**2).sum())))
    return float(np.median(slopes)) if slopes else 0.0
