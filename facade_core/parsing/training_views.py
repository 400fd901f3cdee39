"""What the parser network is taught with: random views of labelled photos, with things put in front of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import ndimage

from facade_core.core.labels import CLASSES, UNKNOWN
from facade_core.parsing.network import PLACE_STRIDE, place_planes

# Side of the square views, and the area in pixels that the whole photo is scaled to before one is cut out.
VIEW_SIDE = 320
_AREA = (90_000, 420_000)
_MOST_GROWTH = 2.0
ANY_CLASS = (1 << len(CLASSES)) - 1
# Cut-outs smaller or larger than these shares of a photo's area say little or hide all.
_CUTOUT_SHARE = (0.0015, 0.3)
_MOST_CUTOUTS = 200
# Higher than this many times their width are people, trees and posts.
_UPRIGHT = 1.4
# Views that have something put in front of them, and how many of these things stand at the photo's foot.
_PUT_IN_FRONT, _AT_FOOT = 0.6, 0.75
# Pixels of a thing in front count as if it covered this share of a view, at most so much more than others: people cover few.
_LARGE_SHARE, _MOST_COUNTED = 0.06, 4.0


class LabelledPhoto(Protocol):
    """A photo (H, W, 3) uint8 RGB; possible (H, W) uint8, bit i set where class i may be; occluder and outside (H, W) uint8:
    1 where something stands in front of the facade, and where sky, street or neighbours are seen beside it, 0 where not,
    UNKNOWN where that is not known."""

    @property
    def image(self) -> np.ndarray: ...
    @property
    def possible(self) -> np.ndarray: ...
    @property
    def occluder(self) -> np.ndarray: ...
    @property
    def outside(self) -> np.ndarray: ...


@dataclass(frozen=True, slots=True)
class TrainingView:
    """image (VIEW, VIEW, 3), possible, occluder and outside (VIEW, VIEW), all uint8; place (2, VIEW / 8, VIEW / 8) float32:
    where in the photo, across and down, from -1 to 1."""

    image: np.ndarray
    possible: np.ndarray
    occluder: np.ndarray
    outside: np.ndarray
    place: np.ndarray


@dataclass(frozen=True, slots=True)
class Cutout:
    """A thing in front, (h, w, 4) uint8 RGBA, and its height as a share of its photo's."""

    image: np.ndarray
    height_share: float


def extract_cutouts(photos: Sequence[LabelledPhoto]) -> tuple[list[Cutout], list[Cutout]]:
    """Trees, cars and the like that the photos show, by photo and place: those that are upright, and the others."""
    found = []
    for photo in photos:
        parts, _ = ndimage.label(photo.occluder == 1)
        sizes = np.bincount(parts.reshape(-1))
        for number, place in enumerate(ndimage.find_objects(parts), start=1):
            share = sizes[number] / parts.size
            if _CUTOUT_SHARE[0] <= share <= _CUTOUT_SHARE[1]:
                alpha = np.where(parts[place] == number, 255, 0).astype(np.uint8)
                piece = np.dstack([photo.image[place], alpha])
                found.append(Cutout(piece, piece.shape[0] / parts.shape[0]))
    upright = [cutout for cutout in found if cutout.piece.shape[0] > _UPRIGHT * cutout.piece.shape[1]]
    others = [cutout for cutout in found if cutout.piece.shape[0] <= _UPRIGHT * cutout.piece.shape[1]]
    return _thinned(upright), _thinned(others)


def _thinned(found: list[Cutout]) -> list[Cutout]:
    return found[:: max(1, len(found) // _MOST_CUTOUTS)]


def occluder_weights(occluder: np.ndarray) -> np.ndarray:
    """What each pixel counts where it is asked whether something is in front, (H, W) float32: 0 where that is not told, 1 where
    nothing is, and the more the smaller the thing, by the root of its area."""
    parts, _ = ndimage.label(occluder == 1)
    areas = np.maximum(np.bincount(parts.reshape(-1)), 1)
    each = np.clip(np.sqrt(_LARGE_SHARE * parts.size / areas), 1, _MOST_COUNTED)
    each[0] = 1
    return np.where(occluder == UNKNOWN, 0, each[parts]).astype(np.float32)


def sample_view(photo: LabelledPhoto, pieces: Sequence[Sequence[Cutout]], rng: np.random.Generator) -> TrainingView:
    """A random view: scale, crop, mirror, things in front, other light, blur, noise. Each group of pieces is drawn from
    as often as the others, however many it holds."""
    image, possible, occluder, outside, place = _cut(photo, rng)
    groups = [group for group in pieces if group]
    if groups and rng.random() < _PUT_IN_FRONT:
        for _ in range(int(rng.integers(1, 5))):
            group = groups[int(rng.integers(len(groups)))]
            image, occluder = _put_in_front(image, occluder, place, group[int(rng.integers(len(group)))], rng)
    if rng.random() < 0.08:
        image = _paint(image, possible, rng)
    return TrainingView(_spoil(_light(image, rng), rng), possible, occluder, outside, place)


def _cut(photo: LabelledPhoto, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """A square of the scaled photo, and where in the photo it lies; beyond the photo's border nothing is known."""
    import cv2

    height, width = photo.possible.shape
    area = math.exp(rng.uniform(math.log(_AREA[0]), math.log(_AREA[1])))
    scale = min(math.sqrt(area / (height * width)), _MOST_GROWTH)
    stretch = math.exp(rng.normal(0, 0.08))
    across, down = scale * stretch, scale / stretch
    wide, high = min(width, math.ceil(VIEW_SIDE / across)), min(height, math.ceil(VIEW_SIDE / down))
    # A third of the views reach down to the photo's foot, where most things stand in front.
    x0, y0 = int(rng.integers(width - wide + 1)), min(int(rng.integers(3 * (height - high) // 2 + 1)), height - high)
    size = (min(VIEW_SIDE, max(1, round(wide * across))), min(VIEW_SIDE, max(1, round(high * down))))
    smooth = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    image, possible, occluder, outside = (
        cv2.resize(np.ascontiguousarray(layer[y0 : y0 + high, x0 : x0 + wide]), size, interpolation=mode)
        for layer, mode in (
            (photo.image, smooth),
            (photo.possible, cv2.INTER_NEAREST),
            (photo.occluder, cv2.INTER_NEAREST),
            (photo.outside, cv2.INTER_NEAREST),
        )
    )
    left, top, whole = x0 * across, y0 * down, (width * across, height * down)
    if rng.random() < 0.2:
        # Rectified textures often show a part of the facade only: the view stands for a whole photo.
        left, top, whole = 0.0, 0.0, size
    corners = (left / whole[0], top / whole[1], (left + VIEW_SIDE) / whole[0], (top + VIEW_SIDE) / whole[1])
    place = place_planes(VIEW_SIDE, VIEW_SIDE, 2 * np.array(corners) - 1)
    pad = ((0, VIEW_SIDE - size[1]), (0, VIEW_SIDE - size[0]))
    image = np.pad(image, (*pad, (0, 0)), mode="edge")
    possible = np.pad(possible, pad, constant_values=ANY_CLASS)
    occluder, outside = (np.pad(layer, pad, constant_values=UNKNOWN) for layer in (occluder, outside))
    layers = [image, possible, occluder, outside]
    if rng.random() < 0.5:
        layers, place = [layer[:, ::-1] for layer in layers], place[:, :, ::-1].copy()
        place[0] *= -1
    return *(layer.copy() for layer in layers), place


def _put_in_front(
    image: np.ndarray, occluder: np.ndarray, place: np.ndarray, cutout: Cutout, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The view with a cut-out over it, most often as high as in its own photo and at the foot of this one. What is
    behind keeps its class."""
    import cv2

    piece = cutout.image
    if rng.random() < _AT_FOOT:
        # From -1 to 1 the photo's height; the view's rows of PLACE_STRIDE pixels tell where that is.
        step = float(place[1, 1, 0] - place[1, 0, 0]) / PLACE_STRIDE
        foot = VIEW_SIDE - PLACE_STRIDE / 2 + (1 - float(place[1, -1, 0])) / step
        high = 2 / step * cutout.height_share * math.exp(rng.normal(0, 0.3))
        bottom = round(foot + high * rng.uniform(-0.1, 0.3))
    else:
        high = VIEW_SIDE * rng.uniform(0.2, 0.7) * piece.shape[0] / max(piece.shape[:2])
        bottom = round(VIEW_SIDE * rng.uniform(0.1, 1.2))
    size = tuple(max(1, round(side * high / piece.shape[0])) for side in piece.shape[1::-1])
    left = round(rng.uniform(-0.5, 1) * VIEW_SIDE) if size[0] > VIEW_SIDE / 2 else round(rng.uniform(-size[0] / 2, VIEW_SIDE))
    if bottom - size[1] >= VIEW_SIDE or max(size) > 4 * VIEW_SIDE:
        return image, occluder
    piece = _light(cv2.resize(piece, size, interpolation=cv2.INTER_AREA), rng)
    if rng.random() < 0.5:
        piece = piece[:, ::-1]
    y0, y1 = max(0, bottom - piece.shape[0]), min(VIEW_SIDE, bottom)
    x0, x1 = max(0, left), min(VIEW_SIDE, left + piece.shape[1])
    if y0 >= y1 or x0 >= x1:
        return image, occluder
    piece = piece[y0 - bottom + piece.shape[0] : y1 - bottom + piece.shape[0], x0 - left : x1 - left]
    # A soft edge, so that the cut is not what gives the thing away.
    alpha = cv2.GaussianBlur(piece[..., 3].astype(np.float32) / 255, (0, 0), rng.uniform(0.5, 1.5))
    image, occluder = image.copy(), occluder.copy()
    behind = image[y0:y1, x0:x1].astype(np.float32)
    image[y0:y1, x0:x1] = np.rint(behind + alpha[..., None] * (piece[..., :3] - behind)).astype(np.uint8)
    occluder[y0:y1, x0:x1][alpha >= 0.5] = 1
    return image, occluder


def _paint(image: np.ndarray, possible: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw each class mostly in its mean colour: drawings and renderings are parsed too."""
    painted = image.astype(np.float32)
    opacity = rng.uniform(0.6, 1.0)
    for value in np.unique(possible[possible != ANY_CLASS]):
        here = possible == value
        colour = image[here].mean(0) + rng.normal(0, 20) + rng.normal(0, 10, 3)
        painted[here] += opacity * (colour - painted[here])
    return np.clip(np.rint(painted), 0, 255).astype(np.uint8)


def _light(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Other exposure, contrast, saturation and tint, seldom none; a fourth channel (alpha) is left as it is."""
    if rng.random() < 0.15:
        return image
    levels = np.arange(256, dtype=np.float32) / 255
    gamma, gain = math.exp(rng.normal(0, 0.25)), np.exp(rng.normal(0, 0.1) + rng.normal(0, 0.05, 3))
    colour = np.stack([(levels**gamma * g * 255).astype(np.float32)[image[..., i]] for i, g in enumerate(gain)], axis=2)
    grey = colour.mean(2, keepdims=True)
    saturation = 0.0 if rng.random() < 0.04 else rng.uniform(0.5, 1.3)
    colour = np.clip(np.rint(grey + saturation * (colour - grey)), 0, 255).astype(np.uint8)
    return np.dstack([colour, image[..., 3:]])


def _spoil(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Blur, coarse pixels, noise or a blank border, each now and then."""
    import cv2

    if rng.random() < 0.15:
        image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.5, 1.6))
    if rng.random() < 0.1:
        noise = rng.normal(0, rng.uniform(2, 10), image.shape[:2]).astype(np.float32)
        image = np.clip(image + noise[..., None], 0, 255).astype(np.uint8)
    if rng.random() < 0.08:
        image = image.copy()
        turned = np.rot90(image, int(rng.integers(4)))  # a view: what is written to it is written to the image
        turned[: int(rng.integers(1, 14))] = rng.choice([0, 128, 255])
    return np.ascontiguousarray(image)
