"""Exemplar from a photo: cut to the facade, complete and measure it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_with_labels
from facade_core.core.types import SHIPPED_MODELS, Box, Element, TrainedModelFiles
from facade_core.facade.evidence import Evidence
from facade_core.facade.exemplar_quality import ExemplarQuality, judge_exemplar
from facade_core.facade.exemplar_trimming import trim_to_facade
from facade_core.facade.facade import Facade, time_stage
from facade_core.facade.photo_facade import NO_DOORS, complete_observed_photo, observe_photo
from facade_core.facade.texture.doors import lengthen_doors
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.imagery.rectify.building_crop import crop_to_facade
from facade_core.imagery.rectify.level_lines import find_slope
from facade_core.imagery.rectify.shadow import shadow_share
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import count_floors, spans_above_threshold

# Smallest width of a shop, metres; narrower ones are errors of the parser.
MIN_SHOP_M = 1.0
# Longer side, in pixels, of a labelled exemplar for counting floors and windows and for measuring shadow.
MAX_COUNTING_SIDE_PX = 640


@dataclass(frozen=True)
class Exemplar:
    """Facade image prepared for retargeting.

    Attributes
    ----------
    evidence, image, labels, occluded : as in `Facade`, cut to the facade.
    box : (x0, y0, x1, y1) of the facade in the picture.
    has_facade : True if a facade was found in the picture.
    metres_per_pixel : metric scale.
    floors : number of floors.
    columns : number of windows in the fullest row.
    shaded_share : share of its wall in shadow.
    quality : judgement of it.
    seconds : seconds of each stage.
    """

    evidence: UInt8Array
    image: UInt8Array
    labels: UInt8Array
    occluded: BoolArray
    box: Box
    has_facade: bool
    metres_per_pixel: float
    floors: int
    columns: int
    shaded_share: float
    quality: ExemplarQuality
    seconds: dict[str, float] = field(compare=False)


def prepare_exemplar(
    image: UInt8Array,
    hidden: BoolArray,
    *,
    floor_height: float,
    private: BoolArray | None = None,
    labels: UInt8Array | None = None,
    models: TrainedModelFiles = SHIPPED_MODELS,
    seed: int = 0,
) -> Exemplar:
    """Cut an exemplar to its facade, complete it and measure it.

    The scale comes from the floor pitch. A wholly visible exemplar with labels is used as it is: it shows the facade
    only.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool pixels known not to show the facade.
    floor_height : metres.
    private : (h, w) bool faces and number plates.
    labels : (h, w) uint8 class ids, if known.
    models : trained models.
    seed : seed of completion and inpainting.

    Raises
    ------
    ImageError
        If too little of the facade is visible, or no window, or if it is not rectified.
    """
    seconds: dict[str, float] = {}
    if labels is not None and not hidden.any() and (private is None or not private.any()):
        _require_level(image, hidden)
        evidence = completed = image
        box, has_facade, occluded, doubtful = (0, 0, image.shape[1], image.shape[0]), True, hidden, hidden
        with time_stage(seconds, "elements"):
            measured, classes = shrink_to_side(image, labels)
            floors, layout = count_floors(classes), tuple(elements(classes))
    else:
        cut = crop_to_facade(image, hidden, model=models)
        has_facade = cut.has_facade
        x0, y0, x1, y1 = cut.box
        private = None if private is None else private[y0:y1, x0:x1]
        seen = Evidence(image=cut.image, hidden=cut.hidden, outside=cut.outside, private=private)
        observed = observe_photo(seen, models=models, seconds=seconds)
        _require_level(cut.image, observed.hidden)
        observed, (left, top, right, bottom) = trim_to_facade(observed)
        box = (x0 + left, y0 + top, x0 + right, y0 + bottom)
        whole, remaining = _complete_twice(replace(observed, private=None), models, seed, seconds)
        evidence, completed, labels, occluded = observed.image, whole.image, whole.labels, whole.occluded
        doubtful = occluded | remaining
        floors, layout, measured, classes = whole.floors, whole.elements, whole.image, labels
    if not floors:
        raise ImageError("no windows are found in it, of which walls could be made; replace or remove it")
    with time_stage(seconds, "scale"):
        scale = exemplar_scale(completed, labels, storey=floor_height)
    completed, labels = lengthen_doors(completed, labels, doubtful, scale)
    shaded = shadow_share(measured, classes)
    with time_stage(seconds, "judge"):
        quality = judge_exemplar(completed, labels, doubtful, scale, shaded)
    return Exemplar(
        evidence=evidence,
        image=completed,
        labels=labels,
        occluded=occluded,
        box=box,
        has_facade=has_facade,
        metres_per_pixel=scale,
        floors=floors,
        columns=count_columns(layout),
        shaded_share=shaded,
        quality=quality,
        seconds=seconds,
    )


def _require_level(image: UInt8Array, hidden: BoolArray) -> None:
    """Raise ImageError for a picture whose level lines slope."""
    slope = find_slope(image, hidden)
    if slope is not None:
        raise ImageError(
            f"its level lines slope by {slope:.0f} degrees; it is not rectified: `streetloom harvest` makes exemplars from "
            "street photos"
        )


def _complete_twice(
    observed: Evidence, models: TrainedModelFiles, seed: int, seconds: dict[str, float]
) -> tuple[Facade, BoolArray]:
    """Complete an exemplar, and again without what a parse of the result still finds before the wall.

    Returns
    -------
    The facade, and what the parse found, (h, w) bool.
    """
    whole = complete_observed_photo(observed, NO_DOORS, models=models, seed=seed, seconds=seconds)
    nothing = np.zeros_like(observed.hidden)
    remaining = observe_photo(Evidence(image=whole.image, hidden=nothing), models=models, seconds=seconds).hidden
    if (remaining & ~observed.hidden).any():
        observed = replace(observed, hidden=observed.hidden | remaining)
        whole = complete_observed_photo(observed, NO_DOORS, models=models, seed=seed, seconds=seconds)
    return whole, remaining


def shrink_to_side(image: UInt8Array, labels: UInt8Array) -> tuple[UInt8Array, UInt8Array]:
    """Shrink an image (h, w, 3) and its labels (h, w) until no side is longer than MAX_COUNTING_SIDE_PX."""
    share = MAX_COUNTING_SIDE_PX / max(labels.shape)
    if share >= 1:
        return image, labels
    height, width = (max(1, round(side * share)) for side in labels.shape)
    return resize_with_labels(image, labels, (height, width))


def count_columns(layout: Sequence[Element]) -> int:
    """Count the windows in the fullest row; windows that overlap in height form a row."""
    windows = sorted((e for e in layout if e.label == "window"), key=lambda e: e.y0 + e.y1)
    best, row, bottom = 0, 0, -np.inf
    for window in windows:
        middle = (window.y0 + window.y1) / 2
        if middle > bottom:
            row, bottom = 0, window.y1
        row += 1
        best = max(best, row)
    return best


def measure_narrowest_shop(labels: UInt8Array, metres_per_pixel: float) -> float:
    """Measure the narrowest shop of an exemplar's labels (h, w), metres; 0 without shops."""
    has_shop = (labels == FacadeClass.SHOP).any(axis=0).astype(np.float64)
    widths = [(right - left) * metres_per_pixel for left, right in spans_above_threshold(has_shop, 0.5)]
    return min((width for width in widths if width >= MIN_SHOP_M), default=0.0)
