"""Photos that are turned or taken at night, by brightness and edges, and by where the parser sees sky and ground floor."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_image
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.imagery.rectify.settings import PHOTO_CHECKS
from facade_core.parsing.segmenter import Surroundings

# What rights a photo, by the quarter turns counterclockwise.
REMEDIES = {
    1: "it lies on its side; turn it counterclockwise by 90 degrees",
    2: "it is upside down; turn it by 180 degrees",
    3: "it lies on its side; turn it clockwise by 90 degrees",
}
AT_NIGHT = "it was taken at night: its walls would be dark by day; give one taken by day"
# Longest side of the picture in which borders without data are found, and of that whose brightness is measured.
BORDER_SIDE_PX, BRIGHTNESS_SIDE_PX = 640, 96
# Side of the picture in which a direction is measured.
DIRECTION_SIDE_PX = 96


def check_photo_state(image: UInt8Array, hidden: BoolArray, seen: Surroundings, is_day: bool) -> None:
    """Raise ImageError for a rectified photo that is upside down or on its side, or was taken at night.

    Parameters
    ----------
    image : (H, W, 3) uint8, rectified.
    hidden : (H, W) bool, pixels that do not show the photo.
    seen : the segmented image.
    is_day : whether it is known that it was taken by day.
    """
    if _upright_evidence(seen.labels, hidden) < PHOTO_CHECKS.min_upright_evidence:
        probability = _turn_probabilities(image, hidden)
        best = int(probability.argmax())
        if best and probability[best] > PHOTO_CHECKS.min_turn_probability:
            raise ImageError(REMEDIES[best])
    brightness = image.max(axis=2)
    facade, above = ~(seen.outside | hidden), seen.outside & ~hidden
    above[len(above) // 2 :] = False
    if is_day or not facade.any():
        return
    sky = float(np.median(brightness[above])) if above.mean() >= PHOTO_CHECKS.min_sky_share else np.inf
    lit, middle = np.percentile(brightness[facade], [90, 50]).tolist()
    max_night_sky = min(PHOTO_CHECKS.max_rectified_night_sky, PHOTO_CHECKS.max_night_sky_ratio * middle)
    if lit < PHOTO_CHECKS.min_lit_brightness or sky < max_night_sky:
        raise ImageError(AT_NIGHT)


def check_daylight(image: UInt8Array, hidden: BoolArray, exposure: float | None) -> None:
    """Raise ImageError for a photo as taken that was taken at night, by its exposure, else by its brightness.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    hidden : (H, W) bool, pixels that do not show the photo; so do borders without data.
    exposure : exposure value of the photo at ISO 100; None if unknown.
    """
    if exposure is not None:
        if exposure < PHOTO_CHECKS.min_daylight_exposure:
            raise ImageError(AT_NIGHT)
        return
    image, hidden = _shrink(image, hidden, BORDER_SIDE_PX)
    image, hidden = _shrink(image, hidden | no_data_mask(image), BRIGHTNESS_SIDE_PX)
    brightness, quarter = image.max(axis=2), len(image) // 4
    upper, rest = (brightness[rows][~hidden[rows]] for rows in (slice(0, quarter), slice(quarter, None)))
    if not len(upper) or not len(rest):
        return
    both = np.concatenate([upper, rest])
    measured = [np.median(upper), np.percentile(upper, 90), np.percentile(both, 99), np.median(rest)]
    if (np.log(np.array(measured) + 8) * PHOTO_CHECKS.night_weights).sum() + PHOTO_CHECKS.night_bias > 0:
        raise ImageError(AT_NIGHT)


def measure_direction(image: UInt8Array) -> Float64Array:
    """Measure the features (10,) of a picture (n, n, 3) by which the weights of `PhotoChecks` know which side is up.

    Light comes from above: the upper sides of ledges are bright. Ground floors have other edges than storeys and roofs.
    """
    side = len(image)
    grey = np.log(image.astype(np.float64).mean(axis=2) + 16)
    below = (np.arange(side) + 0.5) / side - 0.5
    down, across = np.diff(grey, axis=0)[:, :-1], np.diff(grey, axis=1)[:-1]
    level, upright = np.abs(down).mean(axis=1), np.abs(across).mean(axis=1)
    total = level.mean() + upright.mean() + 1e-6
    strong = np.clip(np.abs(down) / (3 * level.mean() + 1e-6), 0, 3) ** 2
    top, foot = below[:-1] < -0.3, below[:-1] > 0.3
    return np.array(
        [
            (grey.mean(axis=1) * below).sum() / (grey.std() + 0.02) / 8,
            (level * below[:-1]).sum() / total,
            (upright * below[:-1]).sum() / total,
            (down**3).mean() / ((down**2).mean() ** 1.5 + 1e-9),
            (strong * np.sign(down)).mean(),
            np.log((level.mean() + 0.002) / (upright.mean() + 0.002)),
            *(edges[rows].sum() / total / 30 for edges in (upright, level) for rows in (top, foot)),
        ]
    )


def _turn_probabilities(image: UInt8Array, hidden: BoolArray) -> Float64Array:
    """Return the probability (4,) that a picture is upright after each number of quarter turns counterclockwise."""
    size = (DIRECTION_SIDE_PX, DIRECTION_SIDE_PX)
    filled = np.where(hidden[..., None], image[~hidden].mean(axis=0).astype(np.uint8), image)
    small = resize_image(filled, size)
    score = np.array(
        [(measure_direction(np.rot90(small, turns)) * PHOTO_CHECKS.turn_weights).sum() for turns in range(4)]
    )
    odds = np.exp(score - score.max())
    return np.asarray(odds / odds.sum())


def _shrink(image: UInt8Array, hidden: BoolArray, side: int) -> tuple[UInt8Array, BoolArray]:
    """Shrink a picture to at most `side` pixels a side."""
    share = min(1.0, side / max(hidden.shape))
    size = (max(1, round(hidden.shape[0] * share)), max(1, round(hidden.shape[1] * share)))
    return resize_image(image, size), resize_image(hidden.astype(np.uint8) * 255, size) > 0


def _upright_evidence(labels: UInt8Array, hidden: BoolArray) -> float:
    """Area of sky and roof above the middle and of doors and shops below it, less the reverse, weighed by distance."""
    below = (np.arange(len(labels)) + 0.5) / len(labels) - 0.5
    top = np.isin(labels, (FacadeClass.SKY, FacadeClass.ROOF)) & ~hidden
    foot = np.isin(labels, (FacadeClass.DOOR, FacadeClass.SHOP)) & ~hidden
    return float(((foot.mean(axis=1) - top.mean(axis=1)) * below).sum()) / len(labels)
