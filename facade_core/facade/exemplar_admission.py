"""Admission of facade pictures as exemplars: the reasons against one, and its judgement by `exemplar_quality`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.core.types import Element
from facade_core.facade.exemplar import count_columns, shrink_to_side
from facade_core.facade.exemplar_quality import (
    JUDGED_PIXELS_PER_METRE,
    MAX_SHADED_SHARE,
    ExemplarQuality,
    judge_exemplar,
)
from facade_core.facade.vegetation import measure_tree_share
from facade_core.imagery.rectify.shadow import shadow_share
from facade_core.parsing.floor_structure import count_floors

# Pixels per metre below which windows have no frames.
MIN_PIXELS_PER_METRE = 12.0
# Sharpness and straightness of a judgement below which a picture is rejected. On 18 blurred training facades this
# sharpness is a blur of 0.52 (Crete et al. 2007), and this straightness a lean of four degrees.
MIN_SHARPNESS = 0.1
MIN_STRAIGHTNESS = 0.1
# Largest hidden share of a picture, and of each third of its rows.
MAX_HIDDEN_SHARE = 0.30
MAX_HIDDEN_THIRD = 0.50
# Largest share of trees that are not hidden, which completion leaves in the picture.
MAX_TREE_SHARE = 0.02
# Windows at the lower border, over those in the fullest row of pixels, from which it cuts through a floor, and its rows as a
# share of the width.
MIN_CUT_FLOOR_SHARE = 0.85
FOOT_SHARE = 0.012
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
# Largest share of the wall in a shadow.
MAX_SHADOW_SHARE = 0.35
# Median brightness of each third, of 255, within which colours are seen: the foot may be in a deep shadow.
MIN_BRIGHTNESS = 45.0
MAX_BRIGHTNESS = 248.0
# Thirds of a facade, from above.
ZONES = ("top", "middle", "foot")


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
    """

    image: UInt8Array
    labels: UInt8Array
    hidden: BoolArray
    elements: Sequence[Element]
    metres_per_pixel: float

    def windows(self) -> list[Element]:
        """Return its windows."""
        return [each for each in self.elements if each.label == "window"]


class CandidateAssessment(NamedTuple):
    """Judgement of a facade picture as an exemplar.

    Attributes
    ----------
    quality : judgement, as of every exemplar.
    reasons : why it is rejected, in words; empty if it can be used.
    """

    quality: ExemplarQuality
    reasons: tuple[str, ...]


def assess_candidate(picture: FacadePicture) -> CandidateAssessment:
    """Judge a rectified picture of one facade, with its parse, as an exemplar."""
    seen = np.where(picture.hidden, np.uint8(UNKNOWN), picture.labels)
    shaded = shadow_share(*shrink_to_side(picture.image, seen))
    quality = judge_exemplar(picture.image, picture.labels, picture.hidden, picture.metres_per_pixel, shaded)
    return CandidateAssessment(quality, (*_explain_content(picture), *_explain_quality(picture, quality)))


def _explain_content(picture: FacadePicture) -> list[str]:
    """Reasons against what a picture shows."""
    windows = picture.windows()
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
        (_cuts_lowest_floor(picture.labels), "its lowest floor is cut off"),
        (confidence < MIN_WINDOW_CONFIDENCE, f"its windows are uncertain ({confidence:.0%} on average)"),
    )
    return [reason for is_wrong, reason in checks if is_wrong]


def _explain_quality(picture: FacadePicture, quality: ExemplarQuality) -> list[str]:
    """Reasons against how a picture shows its facade."""
    windows, density = picture.windows(), 1 / picture.metres_per_pixel
    cut, deviation = _cut_share(picture.hidden, windows), _row_deviation(windows)
    shadow = (1 - quality.light) * MAX_SHADED_SHARE
    trees = measure_tree_share(picture.image, picture.labels, picture.hidden)
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
        (
            quality.sharpness < MIN_SHARPNESS,
            f"blurred (sharpness {quality.sharpness:.2f} at {JUDGED_PIXELS_PER_METRE:.0f} pixels per metre)",
        ),
        (hidden > MAX_HIDDEN_SHARE, f"{hidden:.0%} of it is hidden"),
        (thirds[third] > MAX_HIDDEN_THIRD, f"{thirds[third]:.0%} of its {ZONES[third]} is hidden"),
        (trees > MAX_TREE_SHARE, f"trees cover {trees:.0%} of it"),
        (cut > MAX_CUT_SHARE, f"{cut:.0%} of its windows are hidden in part"),
        (deviation > MAX_ROW_DEVIATION, f"its windows are in no rows (off by {deviation:.0%} of their height)"),
        (quality.straight < MIN_STRAIGHTNESS, "its columns of windows lean"),
        (shadow > MAX_SHADOW_SHARE, f"a shadow covers {shadow:.0%} of its wall"),
        (light[dark] < MIN_BRIGHTNESS, f"its {ZONES[dark]} is too dark ({light[dark]:.0f} of 255)"),
        (light[bright] > MAX_BRIGHTNESS, f"its {ZONES[bright]} is overexposed"),
    )
    return [reason for is_wrong, reason in checks if is_wrong]


def _cuts_lowest_floor(labels: UInt8Array) -> bool:
    """Return whether the lower border cuts through a row of windows."""
    window = labels == FacadeClass.WINDOW
    foot = window[-max(2, round(FOOT_SHARE * labels.shape[1])) :].any(axis=0).mean()
    return bool(foot > 0 and foot >= MIN_CUT_FLOOR_SHARE * window.mean(axis=1).max())


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
