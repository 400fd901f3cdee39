"""Photos that are turned or taken at night, by where the parser sees sky, roof and ground floor, and by brightness."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_image
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.parsing.segmenter import Surroundings, segment_surroundings

# Evidence below which a photo is also looked at upside down and on either side,
MIN_UPRIGHT_EVIDENCE = 0.03
# and by how much more there must be then.
MIN_UPRIGHT_GAIN = 0.04
# What rights a photo, by the quarter turns counterclockwise.
REMEDIES = {
    1: "it lies on its side; turn it counterclockwise by 90 degrees",
    2: "it is upside down; turn it by 180 degrees",
    3: "it lies on its side; turn it clockwise by 90 degrees",
}
# Longest side of the picture in which night is looked for before a photo is rectified.
DAYLIGHT_SIDE_PX = 640
# Largest median brightness of the sky at night, of 255, in a photo as taken.
MAX_NIGHT_SKY = 115
# In a rectified photo neighbours may be all that is above it, so it must be as dark as this,
MAX_RECTIFIED_NIGHT_SKY = 70
# and darker than the facade by this factor: in the shade of a clear day the sky is brighter.
MAX_NIGHT_SKY_RATIO = 0.75
# Share of the picture from which the sky counts, as taken and rectified.
MIN_SKY_SHARE = 0.02
MIN_RECTIFIED_SKY_SHARE = 0.01
# Exposure value at ISO 100 below which a scene is lit by lamps: 8 to 9 a few minutes after sunset, 4 to 5 in a lit street.
MIN_DAYLIGHT_EXPOSURE = 6.5
# Median brightness of the upper quarter of a photo as taken of unknown exposure, below which it shows the sky of the night or
# an unlit wall.
MIN_UPPER_BRIGHTNESS = 55
# Brightness that a tenth of a facade exceeds by day, also where most of it is in the shade.
MIN_LIT_BRIGHTNESS = 90
AT_NIGHT = "it was taken at night: its walls would be dark by day; give one taken by day"


def check_photo_state(
    image: UInt8Array, hidden: BoolArray, seen: Surroundings, *, model: str | Path | None = None
) -> None:
    """Raise ImageError for a rectified photo that is upside down or on its side, or was taken at night.

    Parameters
    ----------
    image : (H, W, 3) uint8, rectified.
    hidden : (H, W) bool, pixels that do not show the photo.
    seen : the segmented image.
    model : parser model, the shipped one by default.
    """
    upright = _upright_evidence(seen.labels, hidden)
    if upright < MIN_UPRIGHT_EVIDENCE:
        turned = {turns: _evidence_turned(image, hidden, turns, model) for turns in REMEDIES}
        best = max(turned, key=turned.__getitem__)
        if turned[best] > max(upright, 0.0) + MIN_UPRIGHT_GAIN:
            raise ImageError(REMEDIES[best])
    _require_daylight(
        image, hidden, seen.outside, MIN_RECTIFIED_SKY_SHARE, MAX_RECTIFIED_NIGHT_SKY, MAX_NIGHT_SKY_RATIO
    )


def check_daylight(
    image: UInt8Array, hidden: BoolArray, exposure: float | None, *, model: str | Path | None = None
) -> None:
    """Raise ImageError for a photo as taken that was taken at night.

    Parameters
    ----------
    image : (H, W, 3) uint8; looked at with at most DAYLIGHT_SIDE_PX a side.
    hidden : (H, W) bool, pixels that do not show the photo; so do borders without data.
    exposure : exposure value of the photo at ISO 100; None if unknown.
    model : parser model, the shipped one by default.
    """
    if exposure is not None and exposure < MIN_DAYLIGHT_EXPOSURE:
        raise ImageError(AT_NIGHT)
    shrink = min(1.0, DAYLIGHT_SIDE_PX / max(hidden.shape))
    size = (max(1, round(hidden.shape[0] * shrink)), max(1, round(hidden.shape[1] * shrink)))
    image = resize_image(image, size)
    hidden = no_data_mask(image) | (resize_image(hidden.astype(np.uint8) * 255, size) > 0)
    upper = np.s_[: len(image) // 4]
    seen = image[upper].max(axis=2)[~hidden[upper]]
    if exposure is None and len(seen) and np.median(seen) < MIN_UPPER_BRIGHTNESS:
        raise ImageError(AT_NIGHT)
    if not hidden.all():
        outside = segment_surroundings(image, hidden, model=model).outside
        _require_daylight(image, hidden, outside, MIN_SKY_SHARE, MAX_NIGHT_SKY)


def _require_daylight(
    image: UInt8Array,
    hidden: BoolArray,
    outside: BoolArray,
    min_sky_share: float,
    max_night_sky: float,
    max_ratio: float = np.inf,
) -> None:
    """Raise ImageError for a dark facade, or what is dark above it, also `max_ratio` times as dark as the facade."""
    brightness = image.max(axis=2)
    facade, above = ~(outside | hidden), outside & ~hidden
    above[len(above) // 2 :] = False
    if not facade.any():
        return
    sky = float(np.median(brightness[above])) if above.mean() >= min_sky_share else np.inf
    lit, middle = np.percentile(brightness[facade], [90, 50]).tolist()
    if lit < MIN_LIT_BRIGHTNESS or sky < min(max_night_sky, max_ratio * middle):
        raise ImageError(AT_NIGHT)


def _evidence_turned(image: UInt8Array, hidden: BoolArray, turns: int, model: str | Path | None) -> float:
    """Return the upright evidence of a picture after some quarter turns counterclockwise."""
    turned, turned_hidden = np.ascontiguousarray(np.rot90(image, turns)), np.ascontiguousarray(np.rot90(hidden, turns))
    return _upright_evidence(segment_surroundings(turned, turned_hidden, model=model).labels, turned_hidden)


def _upright_evidence(labels: UInt8Array, hidden: BoolArray) -> float:
    """Area of sky and roof above the middle and of doors and shops below it, less the reverse, weighed by distance."""
    below = (np.arange(len(labels)) + 0.5) / len(labels) - 0.5
    top = np.isin(labels, (FacadeClass.SKY, FacadeClass.ROOF)) & ~hidden
    foot = np.isin(labels, (FacadeClass.DOOR, FacadeClass.SHOP)) & ~hidden
    return float((foot.mean(axis=1) - top.mean(axis=1)) @ below) / len(labels)
