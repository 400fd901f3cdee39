"""Facade from a photo: parse, complete the layout, inpaint, fit lattice and variations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import HiddenFacadeError
from facade_core.core.provenance import Provenance
from facade_core.core.types import SHIPPED_MODELS, Completion, Element, TrainedModelFiles
from facade_core.facade.evidence import Evidence
from facade_core.facade.facade import Facade, time_stage
from facade_core.facade.layout import model as layouts
from facade_core.facade.layout.completion import complete
from facade_core.facade.texture.hidden_foot import find_hidden_foot, repeat_storeys
from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.texture_faults import foreign_share, inpainting_doubt
from facade_core.facade.variation.encoding import encode
from facade_core.parsing.confidence import box_coverage, calibrate_elements, load_calibration
from facade_core.parsing.elements import elements
from facade_core.parsing.lattice import lattice
from facade_core.parsing.occluders import OCCLUDER_RIM_SHARE, clean_occluder_mask, dilate, remove_occluders_lining_hole
from facade_core.parsing.segmenter import parse_segmentation, segment_picture

# Smallest visible share of a facade to complete; with less the result would be a guess.
MIN_VISIBLE_SHARE = 0.05
# Rim of hidden pixels, as a share of the side, over which their filling fades into the photo.
BLENDING_RIM_SHARE = 0.006
# Largest hidden share of an observed element.
MAX_HIDDEN_SHARE = 0.3


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


NO_DOORS = MappedDoors()


def build_facade_from_photo(
    evidence: Evidence, *, doors: MappedDoors = NO_DOORS, models: TrainedModelFiles = SHIPPED_MODELS, seed: int = 0
) -> Facade:
    """Run all stages on the rectified picture of a facade.

    Occluders that the parser finds are inpainted, so that no tree, face or number plate stays in the texture.

    Parameters
    ----------
    evidence : picture and knowledge of its pixels.
    doors : doors from the map.
    models : trained models.
    seed : seed of completion.

    Raises
    ------
    HiddenFacadeError
        If less than MIN_VISIBLE_SHARE of the facade is visible.
    """
    made = complete_photo(evidence, doors, models=models, seed=seed)
    with time_stage(made.seconds, "encode"):
        return replace(made, hierarchy=encode(made.image, made.elements))


def observe_photo(
    evidence: Evidence, *, models: TrainedModelFiles = SHIPPED_MODELS, seconds: dict[str, float] | None = None
) -> Evidence:
    """Parse a picture and find its occluders, which it then hides, and visible elements.

    Parameters
    ----------
    seconds : receives the seconds of each step.

    Raises
    ------
    HiddenFacadeError
        If less than MIN_VISIBLE_SHARE of the facade is visible.
    """
    timings: dict[str, float] = {} if seconds is None else seconds
    hidden = evidence.hidden
    _require_visible(hidden, "of it")
    with time_stage(timings, "parse"):
        segmentation = evidence.segmentation
        if segmentation is None:
            segmentation = segment_picture(evidence.image, hidden, model=models)
        parsing = parse_segmentation(segmentation, hidden)
        occluded = (
            np.zeros_like(hidden) if evidence.is_clean else remove_occluders_lining_hole(parsing.occluded, hidden)
        )
        if evidence.facade is not None:
            occluded &= ~evidence.facade
        occluders, masked = clean_occluder_mask(occluded)
        if evidence.private is not None:
            occluders |= evidence.private
        masked_share = float((occluders & ~hidden).mean())
        hidden = hidden | occluders
        if evidence.outside is not None:
            hidden |= dilate(evidence.outside, OCCLUDER_RIM_SHARE)
    _require_visible(hidden, "beside sky, trees, cars and the like")
    with time_stage(timings, "elements"):
        observed = tuple(e for e in elements(parsing) if box_coverage(hidden, e) <= MAX_HIDDEN_SHARE)
    return replace(
        evidence,
        hidden=hidden,
        masked=evidence.masked + masked,
        masked_share=evidence.masked_share + masked_share,
        segmentation=segmentation,
        parsed=parsing,
        elements=observed,
    )


def complete_photo(evidence: Evidence, doors: MappedDoors, *, models: TrainedModelFiles, seed: int) -> Facade:
    """Parse and complete a picture, without variations; parameters as in `build_facade_from_photo`."""
    seconds: dict[str, float] = {}
    observed = observe_photo(evidence, models=models, seconds=seconds)
    return complete_observed_photo(observed, doors, models=models, seed=seed, seconds=seconds)


def complete_observed_photo(
    photo: Evidence, doors: MappedDoors, *, models: TrainedModelFiles, seed: int, seconds: dict[str, float]
) -> Facade:
    """Complete an observed picture, without variations; other parameters as in `build_facade_from_photo`.

    Parameters
    ----------
    photo : the observed picture.
    seconds : receives the seconds of each step.
    """
    image, hidden, parsing, segmentation = photo.image, photo.hidden, photo.parsing, photo.segmentation
    completion, layout = None, list(photo.elements)
    foot = find_hidden_foot(image, hidden, parsing.labels, photo.outside)
    if foot is not None and photo.facade is not None and photo.facade[foot.top :].any():
        foot = None  # somebody says that it shows the facade
    if hidden.any():
        with time_stage(seconds, "complete"):
            completion = _complete_layout(photo, doors, models, seed)
            layout = layout if completion is None else list(completion.elements)
        with time_stage(seconds, "inpaint"):
            missing, labels = hidden, parsing.labels
            if foot is not None:
                image, missing, labels = repeat_storeys(image, hidden, labels, foot)
                layout = [element for element in layout if element.y0 < foot.top]
            image, changed = _inpaint_over_rim(image, missing, labels, layout, models.inpainting)
            height = len(hidden)
            hidden = hidden | changed | (np.arange(height)[:, None] >= (height if foot is None else foot.top))
        # Labels and elements come from the completed picture, which may differ from the planned layout.
        with time_stage(seconds, "parse"):
            segmentation = segment_picture(image, nothing := np.zeros_like(hidden), model=models.parser)
            parsing = parse_segmentation(segmentation, nothing)
        with time_stage(seconds, "elements"):
            layout = elements(replace(parsing, occluded=nothing))
    calibration = load_calibration(models.parser)
    estimates = calibration.estimate(parsing, layout, hidden)
    with time_stage(seconds, "lattice"):
        split = lattice(parsing.labels)
    return Facade(
        evidence=photo.image,
        image=image,
        labels=parsing.labels,
        occluded=hidden,
        provenance=np.where(hidden, Provenance.INPAINTED, Provenance.PHOTO).astype(np.uint8),
        masked=photo.masked,
        masked_share=photo.masked_share,
        lattice=split,
        elements=tuple(calibrate_elements(layout, calibration, hidden)),
        hierarchy=None,
        completion=completion,
        estimates=estimates,
        foreign_share=0.0 if photo.is_clean or segmentation is None else foreign_share(segmentation),
        inpainting_doubt=inpainting_doubt(parsing.confidence, hidden),
        floors=int(estimates.value.floors),
        seconds=seconds,
    )


def _complete_layout(photo: Evidence, doors: MappedDoors, models: TrainedModelFiles, seed: int) -> Completion | None:
    """Complete the elements of an observed picture; None where it shows none."""
    if not photo.elements:
        return None
    height, width = photo.hidden.shape
    return complete(
        photo.elements,
        (0, 0, width, height),
        photo.visible_boxes(),
        seed=seed,
        evidence=photo.occluded_parsing(),
        entrances=[share * width for share in doors.entrances],
        front=doors.front,
        model=None if models.layout is None else layouts.load_cached_model(models.layout),
    )[0]


def _inpaint_over_rim(
    image: UInt8Array, hidden: BoolArray, labels: UInt8Array, layout: Sequence[Element], model: Path | None = None
) -> tuple[UInt8Array, BoolArray]:
    """Inpaint hidden pixels and a rim around them, which fades into the photo: (h, w, 3) uint8, and (h, w) bool what changed.

    The rim is what an occluder blurs, so that no source has it, and a hole has no hard seam.
    """
    import cv2

    rim = dilate(hidden, BLENDING_RIM_SHARE)
    if 1 - rim.mean() < MIN_VISIBLE_SHARE:
        rim = hidden
    filled = inpaint(image, rim, labels=labels, elements=list(layout), model=model)
    distance = cv2.distanceTransform((~hidden).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    width = 2 + round(BLENDING_RIM_SHARE * np.sqrt(hidden.size))
    share = np.where(rim, np.clip(distance / width, 0, 1), 1.0)[..., None]
    return np.rint(share * image + (1 - share) * filled).astype(np.uint8), rim


def _require_visible(hidden: BoolArray, cause: str) -> None:
    seen = 1 - hidden.mean()
    if seen < MIN_VISIBLE_SHARE:
        raise HiddenFacadeError(
            f"only {seen:.1%} of the facade is seen {cause}, and {MIN_VISIBLE_SHARE:.0%} are the least; "
            "give a photo that shows more of it, or none"
        )
