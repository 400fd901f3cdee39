"""Photos of facades: read, rectified if they are as taken, and cropped to their facade."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catalogs.readers.settings import PICTURES
from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.resizing import resize_image
from facade_core.imagery.detect.detection import FacesPlatesAndText, detect_faces_plates_text
from facade_core.imagery.detect.text import TextLine
from facade_core.imagery.rectify.building_crop import crop_to_building
from facade_core.imagery.rectify.level_lines import MAX_LEVEL_SLOPE_DEG, find_unrectified_slope, measure_level_slope
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.imagery.rectify.photo import REMEDY, Rectified, rectify
from facade_core.imagery.rectify.photo_state import check_daylight
from tasks.stages.shared.images import read_bounded_picture, read_exposure_value, read_focal_length_px

# A photo whose facade is so many times too wide or too high for its wall shows another wall.
MAX_STRETCH = 2.5
# A photo that is enlarged by more than this is blurred on its wall.
MAX_ENLARGEMENT = 2.0
BLURRED = "it has less than half of its wall's texels, across or down, and is blurred there; give a larger photo"
# Lines of text are legible from this score and number of letters on.
LEGIBLE_SCORE = 0.85
LEGIBLE_LETTERS = 4
# Signs that only the mirror image of a mirrored photo has.
MIN_MIRRORED_SIGNS = 2


class PhotoCropQuality(NamedTuple):
    """Fit of a photo to its wall.

    Attributes
    ----------
    kept : share of the rectified picture that was cut out.
    found : whether a facade was found.
    stretched : how many times wider, for its height, the wall is than the cut.
    notes : sentences on parts that were cut off, and on blur.
    """

    kept: float
    found: bool
    stretched: float
    notes: tuple[str, ...] = ()


class FacadePhoto(NamedTuple):
    """A photo cropped to its facade.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool, not shown.
    outside : (h, w) bool, shown beside the facade.
    seen : faces, plates and text.
    fit : fit to the wall.
    whole : its facade, in all the pixels of the photo.
    """

    image: UInt8Array
    hidden: BoolArray
    outside: BoolArray
    seen: FacesPlatesAndText
    fit: PhotoCropQuality
    whole: CroppedPhoto


class CroppedPhoto(NamedTuple):
    """Part of a photo that shows its facade, rectified.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool, not shown.
    outside : (h, w) bool, shown beside the facade.
    kept : share of the rectified picture.
    has_facade : False if none was found; the picture then stays whole.
    corners : (4, 2) of the part in the photo, x and y in pixels, clockwise from the upper left.
    notes : what was left out, in words.
    """

    image: UInt8Array
    hidden: BoolArray
    outside: BoolArray
    kept: float
    has_facade: bool
    corners: Float64Array
    notes: tuple[str, ...] = ()


def read_facade_photo(path: Path, rectified: bool, size: tuple[int, int], parser: Path | None = None) -> FacadePhoto:
    """Read a photo of a facade at the size of its wall: rectified if it is as taken, and cropped to the facade.

    Raises
    ------
    ImageError : it cannot be read or rectified, or does not show this wall.
    """
    import cv2

    cut = crop_photo_to_wall(path, rectified, size[1] / size[0], parser)
    across, down = size[1] / cut.image.shape[1], size[0] / cut.image.shape[0]
    hidden, outside = (
        cv2.resize(mask.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
        for mask in (cut.hidden, cut.outside)
    )
    found = detect_faces_plates_text(cut.image)
    if is_mirrored(cut.image, found.lines):
        raise ImageError(f"{path.name}: it is mirrored: its signs read from right to left; flip it")
    seen = found.rescale(across, down)
    blurred = (BLURRED,) if max(across, down) > MAX_ENLARGEMENT else ()
    fit = PhotoCropQuality(cut.kept, cut.has_facade, across / down, (*cut.notes, *blurred))
    return FacadePhoto(resize_image(cut.image, size), hidden, outside, seen, fit, cut)


def crop_photo_to_wall(path: Path, rectified: bool, aspect: float, parser: Path | None = None) -> CroppedPhoto:
    """Crop a photo to the facade of its wall; parameters as of `crop_facade_photo`.

    Raises
    ------
    ImageError : it cannot be read or rectified, or does not show this wall.
    """
    cut = crop_facade_photo(path, rectified, aspect, parser)
    if not (rectified or cut.has_facade):
        raise ImageError(f"{path.name}: no facade is found in it; {REMEDY}")
    facade = cut.image.shape[1] / cut.image.shape[0]
    if not rectified and not 1 / MAX_STRETCH <= aspect / facade <= MAX_STRETCH:
        raise ImageError(
            f"{path.name}: its facade is {facade:.2g} times as wide as high, its wall {aspect:.2g}: "
            "it shows another one; give a photo of this wall"
        )
    return cut


def crop_facade_photo(
    path: Path, rectified: bool, aspect: float | None = None, parser: Path | None = None
) -> CroppedPhoto:
    """Read a photo, rectify it if it is as taken, and crop it to the facade that it was taken for.

    Parameters
    ----------
    aspect : width over height of the wall; None if unknown.
    parser : model file in place of the shipped one.

    Raises
    ------
    ImageError : it cannot be read or rectified, is upside down, was taken at night, or shows no one facade.
    """
    notes = []
    if rectified:
        picture = read_bounded_picture(path, least=PICTURES.min_side_px)
        image, hidden = picture.rgb, picture.hidden | no_data_mask(picture.rgb)
        homography = np.eye(3)
        shape = hidden.shape
    else:
        found, shape = rectify_photo(path, parser)
        image, hidden, homography = found.image, ~found.seen, found.homography
        if found.other_facade is not None:
            notes.append(
                f"two facades of a corner: the one {found.other_facade} of it is left out; take a photo of each from its front"
            )
    middle = homography @ [shape[1] / 2, shape[0] / 2, 1]
    try:
        cut = crop_to_building(image, hidden, middle[0] / middle[2], aspect, model=parser)
    except ImageError as error:
        raise ImageError(f"{path.name}: {error}") from error
    beside = cut.hidden | cut.outside
    if not rectified and (slope := measure_level_slope(cut.image, beside)) > MAX_LEVEL_SLOPE_DEG:
        raise ImageError(f"{path.name}: its level lines slope by {slope:.0f} degrees; {REMEDY}")
    if rectified and (unrectified := find_unrectified_slope(cut.image, beside)) is not None:
        raise ImageError(
            f"{path.name}: its level lines slope by {unrectified:.0f} degrees: it is not rectified; rectify it, or if all "
            "photos are as taken, set `rectified: false`"
        )
    x0, y0, x1, y1 = cut.box
    corners = np.array([[x0, y0, 1], [x1, y0, 1], [x1, y1, 1], [x0, y1, 1]]) @ np.linalg.inv(homography).T
    return CroppedPhoto(
        cut.image,
        cut.hidden,
        cut.outside,
        cut.hidden.size / hidden.size,
        cut.has_facade,
        corners[:, :2] / corners[:, 2:],
        (*notes, *cut.notes),
    )


def is_mirrored(image: UInt8Array, lines: Sequence[TextLine]) -> bool:
    """Return whether the signs on a picture can be read only in its mirror image; False without signs."""
    if len(lines) < MIN_MIRRORED_SIGNS or _count_legible(lines):
        return False
    mirrored = detect_faces_plates_text(np.ascontiguousarray(image[:, ::-1]))
    return _count_legible(mirrored.lines) >= MIN_MIRRORED_SIGNS


def _count_legible(lines: Sequence[TextLine]) -> int:
    """Count the lines that are words with certainty."""
    return sum(line.score >= LEGIBLE_SCORE and len(line.text) >= LEGIBLE_LETTERS for line in lines)


def rectify_photo(path: Path, parser: Path | None = None) -> tuple[Rectified, tuple[int, int]]:
    """Rectify a photo as taken; returns it with its size (h, w) as read.

    Parameters
    ----------
    parser : model file in place of the shipped one.

    Raises
    ------
    ImageError : it was taken at night or cannot be rectified; the message has its name.
    """
    picture = read_bounded_picture(path, least=PICTURES.min_side_px)
    alpha = np.where(picture.hidden, 0, 255).astype(np.uint8)
    focal = read_focal_length_px(path)
    try:
        check_daylight(picture.rgb, picture.hidden, read_exposure_value(path), model=parser)
        found = rectify(np.dstack([picture.rgb, alpha]), focal=None if focal is None else focal * picture.scale)
    except ImageError as error:
        raise ImageError(f"{path.name}: {error}") from error
    return found, picture.hidden.shape
