"""Photos of facades: read, rectified if they are as taken, and cropped to their facade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from catalogs.readers.pictures.decoding import Picture
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.resizing import resize_image
from facade_core.core.types import SHIPPED_MODELS, TrainedModelFiles
from facade_core.facade.evidence import Evidence
from facade_core.imagery.detect.detection import detect_faces_plates_text
from facade_core.imagery.detect.text import TextLine
from facade_core.imagery.rectify.building_crop import crop_to_building
from facade_core.imagery.rectify.crop import FacadeCrop
from facade_core.imagery.rectify.level_lines import find_slope
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.imagery.rectify.photo import REMEDY, Rectified, rectify
from facade_core.imagery.rectify.photo_state import check_daylight
from facade_core.imagery.rectify.settings import PHOTO_FIT
from facade_core.parsing.segmenter import occluder_mask
from tasks.stages.shared.images import read_photo

BLURRED = "it has less than half of its wall's texels, across or down, and is blurred there; give a larger photo"


def read_facade_photo(
    path: Path, rectified: bool, size: tuple[int, int], models: TrainedModelFiles = SHIPPED_MODELS
) -> Evidence:
    """Read a photo of a facade at the size of its wall: rectified if it is as taken, and cropped to the facade.

    Raises
    ------
    ImageError : it cannot be read or rectified, or does not show this wall.
    """
    import cv2

    picture = read_photo(path)
    cut = crop_photo_to_wall(picture, path.name, rectified, size[1] / size[0], models)
    across, down = size[1] / cut.image.shape[1], size[0] / cut.image.shape[0]
    hidden, outside = (
        cv2.resize(mask.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
        for mask in (cut.hidden, cut.outside)
    )
    found = detect_faces_plates_text(cut.image)
    if is_mirrored(cut.image, found.lines):
        raise ImageError(f"{path.name}: it is mirrored: its signs read from right to left; flip it")
    if max(across, down) > PHOTO_FIT.max_enlargement:
        cut = replace(cut, notes=(*cut.notes, BLURRED))
    seen, hidden = found.rescale(across, down), widen_holes(hidden)
    return Evidence(
        image=resize_image(cut.image, size),
        hidden=hidden,
        outside=outside,
        private=seen.private_mask(size),
        confidence=~hidden,
        segmentation=cut.segmentation,
        masked=seen.private_boxes(size),
        source=path.name,
        captured=picture.state.day,
        seen=seen,
        photo=cut,
    )


def describe_crop(evidence: Evidence) -> dict[str, object]:
    """Return the fields of a record on how a photo fits its wall; {} of other pictures."""
    cut = evidence.photo
    if cut is None:
        return {}
    across, down = (side / own for side, own in zip(evidence.hidden.shape[::-1], cut.hidden.shape[::-1], strict=True))
    found = {"cut_kept": round(cut.kept, 4), "cut_found": cut.has_facade, "stretched": round(across / down, 3)}
    return found | ({"cut_notes": list(cut.notes)} if cut.notes else {})


def widen_holes(hidden: BoolArray) -> BoolArray:
    """Widen the holes of a mask (h, w) by their rim, where resampling mixes in the occluder."""
    import cv2

    return cv2.dilate(
        hidden.astype(np.uint8), np.ones((2 * PHOTO_FIT.rim_texels + 1, 2 * PHOTO_FIT.rim_texels + 1), np.uint8)
    ).astype(bool)


def crop_photo_to_wall(
    picture: Picture, name: str, rectified: bool, aspect: float, models: TrainedModelFiles = SHIPPED_MODELS
) -> FacadeCrop:
    """Crop a photo to the facade of its wall; parameters as of `crop_picture`.

    Raises
    ------
    ImageError : it cannot be rectified, or does not show this wall.
    """
    cut = crop_picture(picture, name, rectified, aspect, models)
    if not (rectified or cut.has_facade):
        raise ImageError(f"{name}: no facade is found in it; {REMEDY}")
    facade = cut.image.shape[1] / cut.image.shape[0]
    if not rectified and not 1 / PHOTO_FIT.max_stretch <= aspect / facade <= PHOTO_FIT.max_stretch:
        raise ImageError(
            f"{name}: its facade is {facade:.2g} times as wide as high, its wall {aspect:.2g}: "
            "it shows another one; give a photo of this wall"
        )
    return cut


def crop_facade_photo(path: Path, rectified: bool) -> FacadeCrop:
    """Read a photo and crop it to the facade that it was taken for; parameters and errors as of `crop_picture`."""
    return crop_picture(read_photo(path), path.name, rectified)


def crop_picture(
    picture: Picture,
    name: str,
    rectified: bool,
    aspect: float | None = None,
    models: TrainedModelFiles = SHIPPED_MODELS,
) -> FacadeCrop:
    """Rectify a photo if it is as taken, and crop it to the facade that it was taken for.

    Parameters
    ----------
    picture : the photo.
    name : its name in errors.
    rectified : whether it is rectified.
    aspect : width over height of the wall; None if unknown.
    models : trained models.

    Raises
    ------
    ImageError : it cannot be rectified, is upside down, was taken at night, or shows no one facade or too little of it.
    """
    notes, shape = [], picture.hidden.shape
    if rectified:
        image, hidden = picture.rgb, picture.hidden | no_data_mask(picture.rgb)
        homography = np.eye(3)
    else:
        found = rectify_photo(picture, name)
        image, hidden, homography = found.image, ~found.seen, found.homography
        if found.other_facade is not None:
            notes.append(
                f"two facades of a corner: the one {found.other_facade} of it is left out; take a photo of each from its front"
            )
    middle = multiply_matrices(homography, [shape[1] / 2, shape[0] / 2, 1.0])
    try:
        cut = crop_to_building(image, hidden, middle[0] / middle[2], aspect, is_day=not rectified, model=models)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    _check_facade(cut, name, rectified)
    return replace(cut, notes=(*notes, *cut.notes), kept=cut.hidden.size / hidden.size, homography=homography)


def _check_facade(cut: FacadeCrop, name: str, rectified: bool) -> None:
    """Raise ImageError for a facade whose level lines slope, and for one in a photo as taken that is mostly hidden."""
    beside = cut.hidden | cut.outside
    if cut.segmentation is not None:
        beside |= occluder_mask(cut.segmentation, beside.shape)
    seen = 1 - beside.mean()
    if not rectified and seen < PHOTO_FIT.min_seen_share:
        raise ImageError(f"{name}: only {seen:.0%} of its facade is seen beside trees, cars and the like; {REMEDY}")
    if (slope := find_slope(cut.image, beside)) is None:
        return
    remedy = "it is not rectified; rectify it, or if all photos are as taken, set `rectified: false`"
    raise ImageError(
        f"{name}: its level lines slope by {slope:.0f} degrees{': ' + remedy if rectified else '; ' + REMEDY}"
    )


def is_mirrored(image: UInt8Array, lines: Sequence[TextLine]) -> bool:
    """Return whether the signs on a picture can be read only in its mirror image; False without signs."""
    if len(lines) < PHOTO_FIT.min_mirrored_signs or _count_legible(lines):
        return False
    mirrored = detect_faces_plates_text(np.ascontiguousarray(image[:, ::-1]))
    return _count_legible(mirrored.lines) >= PHOTO_FIT.min_mirrored_signs


def _count_legible(lines: Sequence[TextLine]) -> int:
    """Count the lines that are words with certainty."""
    return sum(line.score >= PHOTO_FIT.legible_score and len(line.text) >= PHOTO_FIT.legible_letters for line in lines)


def rectify_photo(picture: Picture, name: str) -> Rectified:
    """Rectify a photo as taken.

    Parameters
    ----------
    picture : the photo.
    name : its name in errors.

    Raises
    ------
    ImageError : it was taken at night or cannot be rectified.
    """
    alpha = np.where(picture.hidden, 0, 255).astype(np.uint8)
    try:
        check_daylight(picture.rgb, picture.hidden, picture.state.exposure)
        return rectify(np.dstack([picture.rgb, alpha]), focal=picture.state.focal_px)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
