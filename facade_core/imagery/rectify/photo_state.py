"""Photos that are upside down or taken at night, by where the parser sees sky, roof and ground floor, and by brightness."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.parsing.segmenter import Surroundings, segment_surroundings

# Evidence below which a photo is also looked at upside down,
MIN_UPRIGHT_EVIDENCE = 0.03
# and by how much more there must be then.
MIN_UPRIGHT_GAIN = 0.04
# Median brightness at most of a night sky, of 255,
MAX_NIGHT_SKY = 70
# which is darker than the facade by this factor: in the shade of a clear day the sky is brighter.
MAX_NIGHT_SKY_RATIO = 0.75
# Share of the picture from which the sky counts.
MIN_SKY_SHARE = 0.01
# Brightness that a tenth of a facade exceeds by day, also where most of it is in the shade.
MIN_LIT_BRIGHTNESS = 90


def check_photo_state(
    image: UInt8Array, hidden: BoolArray, seen: Surroundings, *, model: str | Path | None = None
) -> None:
    """Raise ImageError for a photo that is upside down, or was taken at night.

    Parameters
    ----------
    image : (H, W, 3) uint8, rectified.
    hidden : (H, W) bool, pixels that do not show the photo.
    seen : the segmented image.
    model : parser model, the shipped one by default.
    """
    upright = _upright_evidence(seen.labels, hidden)
    if upright < MIN_UPRIGHT_EVIDENCE:
        turned, turned_hidden = np.ascontiguousarray(image[::-1, ::-1]), np.ascontiguousarray(hidden[::-1, ::-1])
        labels = segment_surroundings(turned, turned_hidden, model=model).labels
        if _upright_evidence(labels, turned_hidden) > max(upright, 0.0) + MIN_UPRIGHT_GAIN:
            raise ImageError("it is upside down; turn it by 180 degrees")
    brightness = image.max(axis=2)
    facade, above = ~(seen.outside | hidden), seen.outside & ~hidden
    above[len(above) // 2 :] = False
    if not facade.any():
        return
    sky = float(np.median(brightness[above])) if above.mean() >= MIN_SKY_SHARE else np.inf
    lit, middle = np.percentile(brightness[facade], [90, 50]).tolist()
    if lit < MIN_LIT_BRIGHTNESS or sky < min(MAX_NIGHT_SKY, MAX_NIGHT_SKY_RATIO * middle):
        raise ImageError("it was taken at night: its walls would be dark by day; give one taken by day")


def _upright_evidence(labels: UInt8Array, hidden: BoolArray) -> float:
    """Area of sky and roof above the middle and of doors and shops below it, less the reverse, weighed by distance."""
    below = (np.arange(len(labels)) + 0.5) / len(labels) - 0.5
    top = np.isin(labels, (FacadeClass.SKY, FacadeClass.ROOF)) & ~hidden
    foot = np.isin(labels, (FacadeClass.DOOR, FacadeClass.SHOP)) & ~hidden
    return float((foot.mean(axis=1) - top.mean(axis=1)) @ below) / len(labels)
