"""Training views of the parser network: random crops of labelled photos, with pasted occluders."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from facade_core.core.arrays import AnyArray, Float32Array, UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.parsing.network import PLACE_STRIDE, cell_position_planes
from training.datasets.facades import ANY_CLASS, LabelledFacade

# Side of the square views in pixels.
VIEW_SIDE = 320
# Area in pixels to which the whole photo is scaled before a view is cropped.
_AREA_RANGE = (90_000, 420_000)
# Largest enlargement of a photo.
_MAX_ENLARGEMENT = 2.0
# Cut-outs outside this range, as shares of a photo's area, show little or hide all.
_CUTOUT_SHARE_RANGE = (0.0015, 0.3)
_MAX_CUTOUTS = 200
# Height over width of people, trees and posts.
_MIN_UPRIGHT_ASPECT = 1.4
# Share of views with pasted occluders,
_OCCLUDED_SHARE = 0.6
# and share of these occluders at the photo's foot.
_AT_FOOT_SHARE = 0.75
# Share of views with thin occluders where they are painted.
_THIN_SHARE = 0.5
# Square root of the area of a common window, metres; smaller windows, as shares of the photo, are parts of windows.
_WINDOW_SIDE_M, _MIN_WINDOW_SHARE = 1.15, 0.0003
# Height of a photo without windows, metres.
_PHOTO_HEIGHT_M = 14.0
# Pixels of an occluder weigh as if it covered this share of a view,
_REFERENCE_SHARE = 0.06
# at most this much more than others: people cover few pixels.
_MAX_WEIGHT = 4.0


# Paints occluders over a view (H, W, 3) uint8, from its metres per pixel and the row of its ground; returns the view and
# the occluder labels (H, W) uint8 of what was painted.
OccluderPainter = Callable[[UInt8Array, float, float, np.random.Generator], tuple[UInt8Array, UInt8Array]]


@dataclass(frozen=True, slots=True)
class TrainingView:
    """Square crop of a labelled photo.

    Attributes
    ----------
    image : (VIEW_SIDE, VIEW_SIDE, 3) uint8.
    possible, occluder, outside : (VIEW_SIDE, VIEW_SIDE) uint8, as in `LabelledFacade`.
    place : (2, VIEW_SIDE / 8, VIEW_SIDE / 8) float32 position in the photo, across and down, -1 to 1.
    """

    image: UInt8Array
    possible: UInt8Array
    occluder: UInt8Array
    outside: UInt8Array
    place: Float32Array


@dataclass(frozen=True, slots=True)
class OccluderCutout:
    """Occluder cut out of a labelled photo, with alpha.

    Attributes
    ----------
    image : (h, w, 4) uint8 RGBA.
    height_share : its height as a share of its photo's.
    """

    image: UInt8Array
    height_share: float


def extract_occluder_cutouts(photos: Sequence[LabelledFacade]) -> tuple[list[OccluderCutout], list[OccluderCutout]]:
    """Extract the occluders of photos, upright ones and others, ordered by photo and place."""
    cutouts = []
    for photo in photos:
        parts, _ = ndimage.label(photo.occluder == 1)
        sizes = np.bincount(parts.reshape(-1))
        for number, place in enumerate(ndimage.find_objects(parts), start=1):
            share = sizes[number] / parts.size
            if _CUTOUT_SHARE_RANGE[0] <= share <= _CUTOUT_SHARE_RANGE[1]:
                alpha = np.where(parts[place] == number, 255, 0).astype(np.uint8)
                piece = np.dstack([photo.image[place], alpha])
                cutouts.append(OccluderCutout(piece, piece.shape[0] / parts.shape[0]))
    upright = [cutout for cutout in cutouts if cutout.image.shape[0] > _MIN_UPRIGHT_ASPECT * cutout.image.shape[1]]
    others = [cutout for cutout in cutouts if cutout.image.shape[0] <= _MIN_UPRIGHT_ASPECT * cutout.image.shape[1]]
    return _thin_out(upright), _thin_out(others)


def _thin_out(cutouts: list[OccluderCutout]) -> list[OccluderCutout]:
    return cutouts[:: max(1, len(cutouts) // _MAX_CUTOUTS)]


def occluder_loss_weights(occluder: UInt8Array) -> Float32Array:
    """Compute each pixel's weight in the occluder loss: more for smaller occluders, by the root of their area.

    Parameters
    ----------
    occluder : (H, W) uint8, 1 for occluders, 0 for none, UNKNOWN.

    Returns
    -------
    (H, W) float32; 0 where unknown, 1 without an occluder.
    """
    parts, _ = ndimage.label(occluder == 1)
    areas = np.maximum(np.bincount(parts.reshape(-1)), 1)
    weight_by_part = np.clip(np.sqrt(_REFERENCE_SHARE * parts.size / areas), 1, _MAX_WEIGHT)
    weight_by_part[0] = 1
    return np.where(occluder == UNKNOWN, 0, weight_by_part[parts]).astype(np.float32)


def estimate_metres_per_pixel(possible: UInt8Array) -> float:
    """Estimate the scale of a facade photo from the median area of its windows.

    Parameters
    ----------
    possible : (H, W) uint8, bit i set where class i is possible.
    """
    parts, count = ndimage.label(possible == 1 << FacadeClass.WINDOW)
    areas = np.bincount(parts.reshape(-1), minlength=count + 1)[1:]
    areas = areas[areas >= _MIN_WINDOW_SHARE * possible.size]
    return _WINDOW_SIDE_M / math.sqrt(float(np.median(areas))) if areas.size else _PHOTO_HEIGHT_M / len(possible)


def sample_view(
    photo: LabelledFacade,
    cutout_groups: Sequence[Sequence[OccluderCutout]],
    rng: np.random.Generator,
    metres_per_pixel: float = 0.0,
    paint_occluders: OccluderPainter | None = None,
) -> TrainingView:
    """Sample a random view: scale, crop, mirror, pasted and painted occluders, light, blur, noise.

    Parameters
    ----------
    photo : labelled photo.
    cutout_groups : groups of cut-outs, drawn equally often at any size.
    rng : random generator.
    metres_per_pixel : scale of the photo, for `paint_occluders`.
    paint_occluders : painter of thin occluders.
    """
    image, possible, occluder, outside, place = _crop_view(photo, rng)
    if rng.random() < 0.08:
        # Occluders of the photo are painted over, as far as a class is known behind them.
        image, occluder = _paint_flat(image, possible, rng), np.where(occluder == 1, UNKNOWN, occluder).astype(np.uint8)
    groups = [group for group in cutout_groups if group]
    if groups and rng.random() < _OCCLUDED_SHARE:
        for _ in range(int(rng.integers(1, 5))):
            group = groups[int(rng.integers(len(groups)))]
            image, occluder = _paste_occluder(image, occluder, place, group[int(rng.integers(len(group)))], rng)
    if paint_occluders is not None and rng.random() < _THIN_SHARE:
        height, foot = _locate_photo_foot(place)
        scale = metres_per_pixel * len(photo.image) / height
        image, painted = paint_occluders(image, scale, foot, rng)
        occluder = np.where(painted == 0, occluder, painted)
    return TrainingView(_degrade(_vary_light(image, rng), rng), possible, occluder, outside, place)


def _crop_view(photo: LabelledFacade, rng: np.random.Generator) -> tuple[AnyArray, ...]:
    """Square of the scaled photo and its position in the photo; beyond the photo's border nothing is known."""
    import cv2

    height, width = photo.possible.shape
    area = math.exp(rng.uniform(math.log(_AREA_RANGE[0]), math.log(_AREA_RANGE[1])))
    scale = min(math.sqrt(area / (height * width)), _MAX_ENLARGEMENT)
    stretch = math.exp(rng.normal(0, 0.08))
    across, down = scale * stretch, scale / stretch
    wide, high = min(width, math.ceil(VIEW_SIDE / across)), min(height, math.ceil(VIEW_SIDE / down))
    # A third of the views reach down to the photo's foot, where most occluders are.
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
        # Rectified textures often show only a part of the facade: treat the view as a whole photo.
        left, top, whole = 0.0, 0.0, size
    corners = (left / whole[0], top / whole[1], (left + VIEW_SIDE) / whole[0], (top + VIEW_SIDE) / whole[1])
    place = cell_position_planes(VIEW_SIDE, VIEW_SIDE, 2 * np.array(corners) - 1)
    pad = ((0, VIEW_SIDE - size[1]), (0, VIEW_SIDE - size[0]))
    image = np.pad(image, (*pad, (0, 0)), mode="edge")
    possible = np.pad(possible, pad, constant_values=ANY_CLASS)
    occluder, outside = (np.pad(layer, pad, constant_values=UNKNOWN) for layer in (occluder, outside))
    layers = [image, possible, occluder, outside]
    if rng.random() < 0.5:
        layers, place = [layer[:, ::-1] for layer in layers], place[:, :, ::-1].copy()
        place[0] *= -1
    return *(layer.copy() for layer in layers), place


def _paste_occluder(
    image: UInt8Array, occluder: UInt8Array, place: Float32Array, cutout: OccluderCutout, rng: np.random.Generator
) -> tuple[UInt8Array, UInt8Array]:
    """Return a view with a cut-out over it; classes behind stay.

    The cut-out is mostly at its original relative height and at the photo's foot.
    """
    import cv2

    piece = cutout.image
    if rng.random() < _AT_FOOT_SHARE:
        photo_height, foot = _locate_photo_foot(place)
        high = photo_height * cutout.height_share * math.exp(rng.normal(0, 0.3))
        bottom = round(foot + high * rng.uniform(-0.1, 0.3))
    else:
        high = VIEW_SIDE * rng.uniform(0.2, 0.7) * piece.shape[0] / max(piece.shape[:2])
        bottom = round(VIEW_SIDE * rng.uniform(0.1, 1.2))
    size = tuple(max(1, round(side * high / piece.shape[0])) for side in piece.shape[1::-1])
    left = (
        round(rng.uniform(-0.5, 1) * VIEW_SIDE)
        if size[0] > VIEW_SIDE / 2
        else round(rng.uniform(-size[0] / 2, VIEW_SIDE))
    )
    if bottom - size[1] >= VIEW_SIDE or max(size) > 4 * VIEW_SIDE:
        return image, occluder
    piece = _vary_light(np.asarray(cv2.resize(piece, size, interpolation=cv2.INTER_AREA), np.uint8), rng)
    if rng.random() < 0.5:
        piece = piece[:, ::-1]
    y0, y1 = max(0, bottom - piece.shape[0]), min(VIEW_SIDE, bottom)
    x0, x1 = max(0, left), min(VIEW_SIDE, left + piece.shape[1])
    if y0 >= y1 or x0 >= x1:
        return image, occluder
    piece = piece[y0 - bottom + piece.shape[0] : y1 - bottom + piece.shape[0], x0 - left : x1 - left]
    # soft edge: the network must not learn to recognise the cut
    alpha = cv2.GaussianBlur(piece[..., 3].astype(np.float32) / 255, (0, 0), rng.uniform(0.5, 1.5))
    image, occluder = image.copy(), occluder.copy()
    behind = image[y0:y1, x0:x1].astype(np.float32)
    image[y0:y1, x0:x1] = np.rint(behind + alpha[..., None] * (piece[..., :3] - behind)).astype(np.uint8)
    occluder[y0:y1, x0:x1][alpha >= 0.5] = 1
    return image, occluder


def _locate_photo_foot(place: Float32Array) -> tuple[float, float]:
    """Return the photo's height and the row of its foot in pixels of a view with positions `place`."""
    # positions -1 to 1 span the photo's height; rows are PLACE_STRIDE pixels apart
    step = float(place[1, 1, 0] - place[1, 0, 0]) / PLACE_STRIDE
    return 2 / step, VIEW_SIDE - PLACE_STRIDE / 2 + (1 - float(place[1, -1, 0])) / step


def _paint_flat(image: UInt8Array, possible: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Image with each class mostly in its mean colour: the parser is used on drawings and renderings too."""
    painted = image.astype(np.float32)
    opacity = rng.uniform(0.6, 1.0)
    for value in np.unique(possible[possible != ANY_CLASS]):
        is_class = possible == value
        colour = image[is_class].mean(0) + rng.normal(0, 20) + rng.normal(0, 10, 3)
        painted[is_class] += opacity * (colour - painted[is_class])
    return np.clip(np.rint(painted), 0, 255).astype(np.uint8)


def _vary_light(image: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Image of other exposure, contrast, saturation and tint, rarely unchanged; a fourth channel (alpha) stays."""
    if rng.random() < 0.15:
        return image
    levels = np.arange(256, dtype=np.float32) / 255
    gamma, gain = math.exp(rng.normal(0, 0.25)), np.exp(rng.normal(0, 0.1) + rng.normal(0, 0.05, 3))
    colour = np.stack(
        [(levels**gamma * channel_gain * 255).astype(np.float32)[image[..., i]] for i, channel_gain in enumerate(gain)],
        axis=2,
    )
    grey = colour.mean(2, keepdims=True)
    saturation = 0.0 if rng.random() < 0.04 else rng.uniform(0.5, 1.3)
    colour = np.clip(np.rint(grey + saturation * (colour - grey)), 0, 255).astype(np.uint8)
    return np.dstack([colour, image[..., 3:]])


def _degrade(image: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Image with occasional blur, coarse pixels, noise or a blank border."""
    import cv2

    if rng.random() < 0.15:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.5, 1.6)), np.uint8)
    if rng.random() < 0.1:
        noise = rng.normal(0, rng.uniform(2, 10), image.shape[:2]).astype(np.float32)
        image = np.clip(image + noise[..., None], 0, 255).astype(np.uint8)
    if rng.random() < 0.08:
        image = image.copy()
        rotated = np.rot90(image, int(rng.integers(4)))  # a NumPy view: writes change the image
        rotated[: int(rng.integers(1, 14))] = rng.choice([0, 128, 255])
    return np.ascontiguousarray(image)
