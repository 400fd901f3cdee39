"""Exemplar from a street photo as taken: the one facade of it, rectified, parsed, judged, completed and measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.resizing import resize_image
from facade_core.core.types import SHIPPED_MODELS
from facade_core.facade.evidence import Evidence
from facade_core.facade.exemplar import count_columns
from facade_core.facade.exemplar_admission import (
    MIN_PIXELS_PER_METRE,
    MIN_WIDTH_M,
    CandidateAssessment,
    FacadePicture,
    assess_candidate,
)
from facade_core.facade.exemplar_trimming import cut_picture_part, trim_to_facade
from facade_core.facade.photo_facade import (
    NO_DOORS,
    complete_observed_photo,
    observe_photo,
)
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.imagery.detect.facade_detection import detect_on_facade
from facade_core.imagery.rectify.building_crop import crop_to_building
from facade_core.imagery.rectify.level_lines import find_slope
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.imagery.rectify.photo import rectify
from facade_core.parsing.floor_structure import count_floors, fill_sky_and_unknown

# Longest side of an exemplar in pixels.
MAX_SIDE_PX = 2000
# Rows of sky, street or holes at the borders, as a share of a row or column, are cut away.
MAX_BORDER_HIDDEN_SHARE = 0.5
# Median angle in degrees between lines and axes, above which the rest is not computed.
MAX_RESIDUAL_DEG = 0.8
# Storey height in metres that the scale assumes, as blocks do by default.
STOREY_M = 3.2


@dataclass(frozen=True, slots=True, eq=False)
class HarvestedFacade:
    """Facade cut from a street photo, with what was found against it.

    Attributes
    ----------
    image : (h, w, 3) uint8; of an accepted one without occluders, faces and plates.
    labels : (h, w) uint8 class ids.
    hidden : (h, w) bool, pixels that were hidden.
    metres_per_pixel : scale, from its storeys.
    floors, columns : floors, and windows in the fullest row.
    judgement : quality and reasons.
    """

    image: UInt8Array
    labels: UInt8Array
    hidden: BoolArray
    metres_per_pixel: float
    floors: int
    columns: int
    judgement: CandidateAssessment


def harvest_facade(
    photo: UInt8Array,
    focal: float | None,
    *,
    seed: int = 0,
) -> HarvestedFacade:
    """Cut the one facade of a street photo to an exemplar and judge it; a rejected one is not completed.

    Parameters
    ----------
    photo : (h, w, 4) uint8, taken by day, RGB with alpha that hides; so do borders without data.
    focal : focal length in pixels; None if unknown.
    seed : seed of completion and inpainting.

    Raises
    ------
    ImageError : no facade can be rectified or parsed in it; the message says why.
    """
    alpha = np.where(no_data_mask(photo[..., :3]), 0, photo[..., 3])
    rectified = rectify(np.dstack([photo[..., :3], alpha]), focal=focal)
    if rectified.residual > MAX_RESIDUAL_DEG:
        raise ImageError(f"its lines are {rectified.residual:.1f} degrees off the axes")
    middle = multiply_matrices(rectified.homography, [photo.shape[1] / 2, photo.shape[0] / 2, 1.0])
    cut = crop_to_building(rectified.image, ~rectified.seen, middle[0] / middle[2], aspect=None, is_day=True)
    if not cut.has_facade:
        raise ImageError("no facade is found in it")
    if (slope := find_slope(cut.image, cut.hidden | cut.outside)) is not None:
        raise ImageError(f"its level lines still slope by {slope:.0f} degrees")
    _require_size(cut.hidden)
    image, hidden, outside = _limit_size(cut.image, cut.hidden, cut.outside)
    evidence = Evidence(image=image, hidden=hidden, outside=outside, segmentation=cut.segmentation)
    observed = observe_photo(evidence)
    observed, _ = trim_to_facade(cut_picture_part(observed, _seen_part(observed)))
    image = observed.image
    _require_size(observed.hidden)
    labels = fill_sky_and_unknown(observed.parsing.labels)
    if not any(each.label == "window" for each in observed.elements) or not count_floors(labels):
        raise ImageError("no windows are found in it")
    scale = exemplar_scale(image, labels, storey=STOREY_M)
    judgement = assess_candidate(FacadePicture(image, labels, observed.hidden, observed.elements, scale))
    found = HarvestedFacade(
        image, labels, observed.hidden, scale, count_floors(labels), count_columns(observed.elements), judgement
    )
    return found if judgement.reasons else _complete(found, observed, seed)


def _complete(found: HarvestedFacade, observed: Evidence, seed: int) -> HarvestedFacade:
    """Complete an accepted facade without faces and plates, and judge it again by what it has become."""
    private = detect_on_facade(found.image, found.metres_per_pixel).private_mask(observed.hidden.shape)
    observed = replace(observed, hidden=observed.hidden | private)
    whole = complete_observed_photo(observed, NO_DOORS, models=SHIPPED_MODELS, seed=seed, seconds={})
    labels = fill_sky_and_unknown(whole.labels)
    scale = exemplar_scale(whole.image, labels, storey=STOREY_M)
    judgement = assess_candidate(FacadePicture(whole.image, labels, observed.hidden, whole.elements, scale))
    return HarvestedFacade(
        whole.image,
        labels,
        whole.occluded,
        scale,
        whole.floors,
        count_columns(whole.elements),
        judgement,
    )


def _require_size(mask: BoolArray) -> None:
    """Raise ImageError for a picture so small that `assess_candidate` rejects it at any scale."""
    if min(mask.shape) < MIN_WIDTH_M * MIN_PIXELS_PER_METRE:
        raise ImageError(f"{mask.shape[1]} x {mask.shape[0]} pixels are too little of a facade")


def _limit_size(image: UInt8Array, hidden: BoolArray, outside: BoolArray) -> tuple[UInt8Array, BoolArray, BoolArray]:
    """Reduce a picture and its masks to the size of an exemplar."""
    factor = MAX_SIDE_PX / max(hidden.shape)
    if factor >= 1:
        return image, hidden, outside
    size = round(hidden.shape[0] * factor), round(hidden.shape[1] * factor)
    masks = (resize_image(np.where(mask, 255, 0).astype(np.uint8), size) >= 64 for mask in (hidden, outside))
    hidden, outside = masks
    return resize_image(image, size), hidden, outside


def _seen_part(photo: Evidence) -> tuple[int, int, int, int]:
    """Rows and columns from the first to the last that are mostly seen; all if none is."""
    spans: list[int] = []
    for axis in (1, 0):
        seen = np.flatnonzero(photo.hidden.mean(axis=axis) <= MAX_BORDER_HIDDEN_SHARE)
        spans += [int(seen[0]), int(seen[-1]) + 1] if len(seen) else [0, photo.hidden.shape[1 - axis]]
    return spans[0], spans[1], spans[2], spans[3]
