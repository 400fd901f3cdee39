"""Facade from a photo: parse, complete the layout, inpaint, fit lattice and variations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.provenance import Provenance
from facade_core.core.types import SHIPPED_MODELS, Box, Completion, Element, Parsing, TrainedModelFiles
from facade_core.facade.facade import Facade, time_stage
from facade_core.facade.layout import model as layouts
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.visible_region import dilate_hidden_by_window, visible_region_boxes
from facade_core.facade.texture.hidden_foot import find_hidden_foot, repeat_storeys
from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.variation.encoding import encode
from facade_core.parsing.confidence import FacadeEstimates, box_coverage, calibrate_elements, load_calibration
from facade_core.parsing.elements import elements
from facade_core.parsing.lattice import lattice
from facade_core.parsing.occluders import OCCLUDER_RIM_SHARE, clean_occluder_mask, dilate, remove_occluders_lining_hole
from facade_core.parsing.segmenter import parse

# Smallest visible share of a facade to complete; with less the result would be a guess.
MIN_VISIBLE_SHARE = 0.05
# Rim of hidden pixels, as a share of the side, over which their filling fades into the photo.
BLENDING_RIM_SHARE = 0.006
# Largest hidden share of an observed element.
MAX_HIDDEN_SHARE = 0.3


@dataclass(frozen=True)
class PhotoMasks:
    """Knowledge of the pixels of a rectified photo, besides which do not show the facade.

    Attributes
    ----------
    facade : (h, w) bool pixels known to show the facade; no occluder is searched there.
    outside : (h, w) bool sky and street; the parser may use them as context.
    private : (h, w) bool faces and number plates.
    is_clean : True for a photo without occluders.
    """

    facade: BoolArray | None = None
    outside: BoolArray | None = None
    private: BoolArray | None = None
    is_clean: bool = False


@dataclass(frozen=True)
class MappedDoors:
    """Knowledge of a wall's doors from the map, as in `complete`.

    Attributes
    ----------
    entrances : positions of mapped doors as shares of the width.
    front : True for a wall on a street.
    """

    entrances: Sequence[float] = ()
    front: bool = False


NO_MASKS = PhotoMasks()
NO_DOORS = MappedDoors()


class CompletedPhoto(NamedTuple):
    """Parsed and completed photo, before lattice and variations; fields as in `Facade`."""

    image: UInt8Array
    labels: UInt8Array
    occluded: BoolArray
    masked: tuple[Box, ...]
    masked_share: float
    elements: tuple[Element, ...]
    completion: Completion | None
    estimates: FacadeEstimates
    repeated_foot_share: float
    seconds: dict[str, float]


def build_facade_from_photo(
    image: UInt8Array,
    hidden: BoolArray,
    *,
    masks: PhotoMasks = NO_MASKS,
    doors: MappedDoors = NO_DOORS,
    models: TrainedModelFiles = SHIPPED_MODELS,
    seed: int = 0,
) -> Facade:
    """Run all stages on a rectified photo of a facade.

    Occluders that the parser finds are inpainted, so that no tree, face or number plate stays in the texture.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool pixels known not to show the facade.
    masks : knowledge of the other pixels.
    doors : doors from the map.
    models : models of parser and layout.
    seed : seed of completion.

    Raises
    ------
    ImageError
        If less than MIN_VISIBLE_SHARE of the facade is visible.
    """
    made = complete_photo(image, hidden, masks, doors, models=models, seed=seed)
    seconds = made.seconds
    with time_stage(seconds, "lattice"):
        split = lattice(made.labels)
    with time_stage(seconds, "encode"):
        hierarchy = encode(made.image, made.elements)
    return Facade(
        evidence=image,
        image=made.image,
        labels=made.labels,
        occluded=made.occluded,
        provenance=np.where(made.occluded, Provenance.INPAINTED, Provenance.PHOTO).astype(np.uint8),
        masked=made.masked,
        masked_share=made.masked_share,
        lattice=split,
        elements=made.elements,
        hierarchy=hierarchy,
        completion=made.completion,
        estimates=made.estimates,
        repeated_foot_share=made.repeated_foot_share,
        floors=int(made.estimates.value.floors),
        seconds=seconds,
    )


@dataclass(frozen=True, slots=True, eq=False)
class ObservedPhoto:
    """Parse of a photo, its hidden part and the elements seen in the rest.

    Attributes
    ----------
    parsing : parse of the photo.
    hidden : (h, w) bool pixels that do not show the facade.
    masked, masked_share : occluders of the photo, and their share of its pixels.
    observed : elements seen, wholly or in part.
    """

    parsing: Parsing
    hidden: BoolArray
    masked: tuple[Box, ...]
    masked_share: float
    observed: list[Element]

    def visible_boxes(self) -> list[tuple[float, float, float, float]]:
        """Return the visible part as `complete` takes it."""
        region = visible_region_boxes(dilate_hidden_by_window(self.hidden, self.observed))
        return region + [(e.x0, e.y0, e.x1, e.y1) for e in self.observed]

    def evidence(self) -> Parsing:
        """Return the parse with everything hidden marked as occluded."""
        return replace(self.parsing, occluded=self.hidden | self.parsing.occluded)


def observe_photo(
    image: UInt8Array,
    hidden: BoolArray,
    masks: PhotoMasks,
    *,
    models: TrainedModelFiles = SHIPPED_MODELS,
    seconds: dict[str, float] | None = None,
) -> ObservedPhoto:
    """Parse a photo and find its occluders and visible elements; parameters as in `build_facade_from_photo`.

    Parameters
    ----------
    seconds : receives the seconds of each step.

    Raises
    ------
    ImageError
        If less than MIN_VISIBLE_SHARE of the facade is visible.
    """
    timings: dict[str, float] = {} if seconds is None else seconds
    _require_visible(hidden, "of it")
    with time_stage(timings, "parse"):
        alpha = np.where(hidden, 0, 255).astype(np.uint8)
        parsing = parse(np.dstack([image, alpha]), model=models.parser)
        occluded = np.zeros_like(hidden) if masks.is_clean else remove_occluders_lining_hole(parsing.occluded, hidden)
        if masks.facade is not None:
            occluded &= ~masks.facade
        occluders, masked = clean_occluder_mask(occluded)
        if masks.private is not None:
            occluders |= masks.private
        masked_share = float((occluders & ~hidden).mean())
        hidden = hidden | occluders
        if masks.outside is not None:
            hidden |= dilate(masks.outside, OCCLUDER_RIM_SHARE)
    _require_visible(hidden, "beside sky, trees, cars and the like")
    with time_stage(timings, "elements"):
        observed = [e for e in elements(parsing) if box_coverage(hidden, e) <= MAX_HIDDEN_SHARE]
    return ObservedPhoto(parsing, hidden, masked, masked_share, observed)


def complete_photo(
    image: UInt8Array, hidden: BoolArray, masks: PhotoMasks, doors: MappedDoors, *, models: TrainedModelFiles, seed: int
) -> CompletedPhoto:
    """Parse and complete a photo; parameters as in `build_facade_from_photo`."""
    seconds: dict[str, float] = {}
    photo = observe_photo(image, hidden, masks, models=models, seconds=seconds)
    return complete_observed_photo(image, photo, doors, facade=masks.facade, models=models, seed=seed, seconds=seconds)


def complete_observed_photo(
    image: UInt8Array,
    photo: ObservedPhoto,
    doors: MappedDoors,
    *,
    facade: BoolArray | None = None,
    models: TrainedModelFiles,
    seed: int,
    seconds: dict[str, float],
) -> CompletedPhoto:
    """Complete a parsed photo; other parameters as in `build_facade_from_photo`.

    Parameters
    ----------
    photo : the parsed photo.
    facade : (h, w) bool pixels known to show the facade; None if unknown.
    seconds : receives the seconds of each step.
    """
    parsing, hidden, observed = photo.parsing, photo.hidden, photo.observed
    completion, result_parsing, result, layout = None, parsing, image, observed
    foot = find_hidden_foot(image, hidden, parsing.labels)
    if foot is not None and facade is not None and facade[foot.top :].any():
        foot = None  # somebody says that it shows the facade
    if hidden.any():
        height, width = hidden.shape
        with time_stage(seconds, "complete"):
            if observed:
                completion = complete(
                    observed,
                    (0, 0, width, height),
                    photo.visible_boxes(),
                    seed=seed,
                    evidence=photo.evidence(),
                    entrances=[share * width for share in doors.entrances],
                    front=doors.front,
                    model=None if models.layout is None else layouts.load_cached_model(models.layout),
                )[0]
                layout = list(completion.elements)
        with time_stage(seconds, "inpaint"):
            missing, labels = hidden, parsing.labels
            if foot is not None:
                result, missing, labels = repeat_storeys(image, hidden, labels, foot)
                layout = [element for element in layout if element.y0 < foot.top]
            result, changed = _inpaint_over_rim(result, missing, labels, layout)
            hidden = hidden | changed | (np.arange(height)[:, None] >= (height if foot is None else foot.top))
        # Labels and elements come from the completed picture, which may differ from the planned layout.
        with time_stage(seconds, "parse"):
            result_parsing = parse(result, model=models.parser)
        with time_stage(seconds, "elements"):
            layout = elements(replace(result_parsing, occluded=np.zeros_like(hidden)))
    calibration = load_calibration(models.parser)
    estimates = calibration.estimate(result_parsing, layout, hidden)
    layout = calibrate_elements(layout, calibration, hidden)
    return CompletedPhoto(
        result,
        result_parsing.labels,
        hidden,
        photo.masked,
        photo.masked_share,
        tuple(layout),
        completion,
        estimates,
        0.0 if foot is None else 1 - foot.top / len(hidden),
        seconds,
    )


def _inpaint_over_rim(
    image: UInt8Array, hidden: BoolArray, labels: UInt8Array, layout: Sequence[Element]
) -> tuple[UInt8Array, BoolArray]:
    """Inpaint hidden pixels and a rim around them, which fades into the photo: (h, w, 3) uint8, and (h, w) bool what changed.

    The rim is what an occluder blurs, so that no source has it, and a hole has no hard seam.
    """
    import cv2

    rim = dilate(hidden, BLENDING_RIM_SHARE)
    if 1 - rim.mean() < MIN_VISIBLE_SHARE:
        rim = hidden
    filled = inpaint(image, rim, labels=labels, elements=list(layout))
    distance = cv2.distanceTransform((~hidden).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    width = 2 + round(BLENDING_RIM_SHARE * np.sqrt(hidden.size))
    share = np.where(rim, np.clip(distance / width, 0, 1), 1.0)[..., None]
    return np.rint(share * image + (1 - share) * filled).astype(np.uint8), rim


def _require_visible(hidden: BoolArray, cause: str) -> None:
    seen = 1 - hidden.mean()
    if seen < MIN_VISIBLE_SHARE:
        raise ImageError(
            f"only {seen:.1%} of the facade is seen {cause}, and {MIN_VISIBLE_SHARE:.0%} are the least; "
            "give a photo that shows more of it, or none"
        )
