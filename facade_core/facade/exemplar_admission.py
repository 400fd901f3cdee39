"""Admission of facade pictures as exemplars: what is wrong with one, and how good it is before `exemplar_quality` ranks it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_image, resize_with_labels
from facade_core.core.types import Element
from facade_core.facade.exemplar import count_columns
from facade_core.imagery.rectify.shadow import shadow_share
from facade_core.parsing.floor_structure import count_floors

# Pixels per metre below which windows have no frames, and from which more gain nothing.
MIN_PIXELS_PER_METRE = 12.0
GOOD_PIXELS_PER_METRE = 30.0
# Density at which sharpness is measured: that of textures. A coarser picture is blurred there.
SHARPNESS_PIXELS_PER_METRE = 20.0
# Blur (Crete et al. 2007) above which a picture is rejected, and of a sharp one.
MAX_BLUR = 0.52
GOOD_BLUR = 0.30
# Largest hidden share of a picture, and of each third of its rows.
MAX_HIDDEN_SHARE = 0.30
MAX_HIDDEN_THIRD = 0.50
# Largest share of windows that something hides in part.
MAX_CUT_SHARE = 0.35
# Share of an element's box that may be hidden without a loss.
MAX_COVERED_ELEMENT = 0.1
# Floors and columns of windows that a style needs.
MIN_FLOORS = 2
MIN_COLUMNS = 2
# Smallest width and height in metres.
MIN_WIDTH_M = 4.0
MIN_HEIGHT_M = 5.0
# Bounds of the share of windows: less is a blank wall, more is a misread one.
MIN_WINDOW_SHARE = 0.05
MAX_WINDOW_SHARE = 0.60
# Mean confidence of windows below which they may be something else.
MIN_WINDOW_CONFIDENCE = 0.60
# Mean height between a window and its neighbours in the row, as a share of its own.
MAX_ROW_DEVIATION = 0.25
# Median angle in degrees between lines and axes.
MAX_RESIDUAL_DEG = 0.8
# Largest share of the wall in a shadow.
MAX_SHADOW_SHARE = 0.35
# Median brightness of each third, of 255, within which colours are seen: the foot may be in a deep shadow.
MIN_BRIGHTNESS = 45.0
MAX_BRIGHTNESS = 248.0
# Thirds of a facade, from above.
ZONES = ("top", "middle", "foot")
# Longest side in pixels at which labels are measured.
MEASURED_SIDE_PX = 640


@dataclass(frozen=True, slots=True, eq=False)
class FacadePicture:
    """Rectified picture of one facade with its parse.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class ids.
    hidden : (h, w) bool, pixels that do not show the facade.
    elements : windows, balconies, doors and shops that are seen, in pixels.
    metres_per_pixel : scale.
    residual_deg : median angle between its lines and the axes.
    """

    image: UInt8Array
    labels: UInt8Array
    hidden: BoolArray
    elements: Sequence[Element]
    metres_per_pixel: float
    residual_deg: float


class CandidateParts(NamedTuple):
    """Parts of an exemplar's score, 0 to 1 each.

    Attributes
    ----------
    resolution : pixels per metre.
    sharpness : sharpness at the density of textures.
    visible : share that is seen.
    whole : share of the windows that are seen whole.
    regular : alignment of the windows in their rows.
    straight : straightness of the lines.
    light : share of the wall without a cast shadow.
    """

    resolution: float
    sharpness: float
    visible: float
    whole: float
    regular: float
    straight: float
    light: float


class CandidateAssessment(NamedTuple):
    """Judgement of a facade picture as an exemplar.

    Attributes
    ----------
    score : 0 to 1, geometric mean of the parts.
    parts : what it consists of.
    reasons : why it is rejected, in words; empty if it can be used.
    """

    score: float
    parts: CandidateParts
    reasons: tuple[str, ...]


def assess_candidate(picture: FacadePicture) -> CandidateAssessment:
    """Judge a rectified picture of one facade as an exemplar.

    Parameters
    ----------
    picture : picture with its parse.

    References
    ----------
    F. Crete et al., "The blur effect: perception and estimation with a new no-reference perceptual blur metric", 2007.
    """
    density = 1 / picture.metres_per_pixel
    blur = _measure_blur(picture.image, density)
    windows = [each for each in picture.elements if each.label == "window"]
    hidden = float(picture.hidden.mean())
    cut = _cut_share(picture.hidden, windows)
    deviation = _row_deviation(windows)
    shadow = _measure_shadow(picture.image, picture.labels)
    parts = CandidateParts(
        resolution=_rise(density, MIN_PIXELS_PER_METRE / 2, GOOD_PIXELS_PER_METRE),
        sharpness=_rise(-blur, -MAX_BLUR - 0.1, -GOOD_BLUR),
        visible=1 - hidden,
        whole=1 - cut,
        regular=_rise(-deviation, -2 * MAX_ROW_DEVIATION, 0.0),
        straight=_rise(-picture.residual_deg, -2 * MAX_RESIDUAL_DEG, 0.0),
        light=1 - shadow,
    )
    score = float(np.exp(np.mean(np.log(np.maximum(parts, 1e-3)))))
    reasons = (
        *_explain_content(picture, windows),
        *_explain_quality(picture, density, blur, cut, deviation, shadow),
    )
    return CandidateAssessment(score, parts, reasons)


def _explain_content(picture: FacadePicture, windows: Sequence[Element]) -> list[str]:
    """Reasons against what a picture shows."""
    height, width = (side * picture.metres_per_pixel for side in picture.labels.shape)
    floors, columns = count_floors(picture.labels), count_columns(windows)
    share = float((picture.labels == FacadeClass.WINDOW)[~picture.hidden].mean()) if not picture.hidden.all() else 0.0
    confidence = float(np.mean([each.confidence for each in windows])) if windows else 0.0
    checks = (
        (floors < MIN_FLOORS, f"{floors} floors are seen, and {MIN_FLOORS} are the least"),
        (columns < MIN_COLUMNS, f"{columns} columns of windows are seen, and {MIN_COLUMNS} are the least"),
        (width < MIN_WIDTH_M or height < MIN_HEIGHT_M, f"{width:.1f} x {height:.1f} m are too little of a facade"),
        (
            not MIN_WINDOW_SHARE <= share <= MAX_WINDOW_SHARE,
            f"windows are {share:.0%} of it, where {MIN_WINDOW_SHARE:.0%} to {MAX_WINDOW_SHARE:.0%} are usual",
        ),
        (confidence < MIN_WINDOW_CONFIDENCE, f"its windows are uncertain ({confidence:.0%} on average)"),
    )
    return [reason for is_wrong, reason in checks if is_wrong]


def _explain_quality(
    picture: FacadePicture, density: float, blur: float, cut: float, deviation: float, shadow: float
) -> list[str]:
    """Reasons against how a picture shows its facade."""
    hidden = float(picture.hidden.mean())
    thirds = [float(rows.mean()) for rows in np.array_split(picture.hidden, 3)]
    third = int(np.argmax(thirds))
    light = [float(np.median(rows)) for rows in np.array_split(picture.image.max(axis=2), 3)]
    dark, bright = int(np.argmin(light)), int(np.argmax(light))
    checks = (
        (
            density < MIN_PIXELS_PER_METRE,
            f"{density:.0f} pixels per metre, and {MIN_PIXELS_PER_METRE:.0f} are the least",
        ),
        (blur > MAX_BLUR, f"blurred ({blur:.2f} at {SHARPNESS_PIXELS_PER_METRE:.0f} pixels per metre)"),
        (hidden > MAX_HIDDEN_SHARE, f"{hidden:.0%} of it is hidden"),
        (thirds[third] > MAX_HIDDEN_THIRD, f"{thirds[third]:.0%} of its {ZONES[third]} is hidden"),
        (cut > MAX_CUT_SHARE, f"{cut:.0%} of its windows are hidden in part"),
        (deviation > MAX_ROW_DEVIATION, f"its windows are in no rows (off by {deviation:.0%} of their height)"),
        (picture.residual_deg > MAX_RESIDUAL_DEG, f"its lines are {picture.residual_deg:.1f} degrees off the axes"),
        (shadow > MAX_SHADOW_SHARE, f"a shadow covers {shadow:.0%} of its wall"),
        (light[dark] < MIN_BRIGHTNESS, f"its {ZONES[dark]} is too dark ({light[dark]:.0f} of 255)"),
        (light[bright] > MAX_BRIGHTNESS, f"its {ZONES[bright]} is overexposed"),
    )
    return [reason for is_wrong, reason in checks if is_wrong]


def _rise(value: float, low: float, high: float) -> float:
    """Map a value to 0 at `low` and to 1 at `high`."""
    return float(np.clip((value - low) / (high - low), 0.0, 1.0))


def _measure_blur(image: UInt8Array, density: float) -> float:
    """Blur of a picture at the density of textures, 0 to 1."""
    from skimage.measure import blur_effect

    factor = SHARPNESS_PIXELS_PER_METRE / density
    height, width = (max(12, round(side * factor)) for side in image.shape[:2])
    return float(blur_effect(resize_image(image, (height, width)), channel_axis=-1))


def _measure_shadow(image: UInt8Array, labels: UInt8Array) -> float:
    factor = MEASURED_SIDE_PX / max(labels.shape)
    if factor < 1:
        height, width = (max(1, round(side * factor)) for side in labels.shape)
        image, labels = resize_with_labels(image, labels, (height, width))
    return shadow_share(image, labels)


def _cut_share(hidden: BoolArray, windows: Sequence[Element]) -> float:
    """Share of the windows that something hides in part."""
    if not windows:
        return 1.0
    covered = [hidden[round(e.y0) : round(e.y1), round(e.x0) : round(e.x1)].mean() for e in windows]
    return float(np.mean(np.array(covered) > MAX_COVERED_ELEMENT))


def _row_deviation(windows: Sequence[Element]) -> float:
    """Mean distance in height from each window to the nearest of another column, over their height, at most 1."""
    if len(windows) < 2:
        return 1.0
    boxes = np.array([(each.x0, each.x1, (each.y0 + each.y1) / 2) for each in windows])
    size = float(np.median([each.height for each in windows]))
    apart = np.minimum(np.abs(boxes[:, None, 2] - boxes[None, :, 2]) / size, 1.0)
    is_above = (boxes[:, None, 0] < boxes[None, :, 1]) & (boxes[None, :, 0] < boxes[:, None, 1])
    return float(np.where(is_above, 1.0, apart).min(axis=1).mean())
