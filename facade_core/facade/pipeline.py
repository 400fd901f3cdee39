"""Facade pipeline: parse, complete the layout, inpaint, fit lattice and variations, or retarget an exemplar."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.resizing import resize_image, resize_with_labels
from facade_core.core.types import SHIPPED_MODELS, Box, Completion, Element, Lattice, ModelFiles
from facade_core.facade.layout import model as layouts
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.visible_region import dilate_by_window, visible_boxes
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.texture.retargeting import ExemplarStyle
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.facade.texture.tint import tint_facade
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.facade.variation.encoding import encode, encode_variations
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.photo_exchange import exchange_in_photo
from facade_core.facade.variation.variations import find_variations
from facade_core.facade.wall_material import lit_colour
from facade_core.imagery.rectify.crop import crop_to_facade
from facade_core.imagery.rectify.shadow import shadow_share
from facade_core.parsing.confidence import FacadeEstimates, box_coverage, calibrate_elements, load_calibration
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import count_floors
from facade_core.parsing.lattice import lattice
from facade_core.parsing.occluders import OCCLUDER_RIM_SHARE, dilate, occluder_mask, remove_spill
from facade_core.parsing.segmenter import parse

# Smallest visible share of a facade to complete; with less the result would be a guess.
MIN_VISIBLE_SHARE = 0.05
# Largest hidden share of an observed element.
MAX_HIDDEN_SHARE = 0.3
# Longer side, in pixels, of a labelled exemplar for counting floors and windows and for measuring shadow.
MAX_COUNTING_SIDE_PX = 640
# Hierarchy level, as a share of the last one, within whose types a wall's elements are exchanged.
EXCHANGE_LEVEL = 0.75
# Pixels for each texel when a wall on no street is drawn, if the exemplar is that fine; drawn in texels it would be softer.
OVERSAMPLING = 2
# Largest factor by which a wall's bands are lightened or darkened; beyond it grain would dominate.
MAX_PAINT_FACTOR = 4.0
# Metres by which a wall extends behind a neighbour and beyond its edges.
FREE_MARGIN_M = 0.25


@dataclass(frozen=True)
class Facade:
    """Facade after all of its stages.

    Attributes
    ----------
    evidence : (h, w, 3) uint8 image before completion.
    image : (h, w, 3) uint8 completed image.
    labels : (h, w) uint8 completed class ids.
    occluded : (h, w) bool.
    provenance : (h, w) uint8 Provenance.
    masked : boxes (x0, y0, x1, y1) of trees, cars, people and the like that were removed from the image.
    masked_share : share of the image that they hid.
    lattice : irregular lattice of the labels.
    elements : elements with the probability that they exist times their visible share as confidence; 1 without a
        photo.
    hierarchy : variation-factored hierarchy, None for walls on no street.
    completion : completed layout, None if nothing was completed.
    estimates : window share, number of windows and of floors, with intervals; None without a photo.
    floors : number of floors, the ground floor included; 0 without windows.
    seconds : seconds of each stage.
    """

    evidence: UInt8Array
    image: UInt8Array
    labels: UInt8Array
    occluded: BoolArray
    provenance: UInt8Array
    masked: tuple[Box, ...]
    masked_share: float
    lattice: Lattice
    elements: tuple[Element, ...]
    hierarchy: Hierarchy | None
    completion: Completion | None
    estimates: FacadeEstimates | None
    floors: int
    seconds: dict[str, float] = field(compare=False)


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
    seconds: dict[str, float] = field(compare=False)


class _CompletedPhoto(NamedTuple):
    """Parsed and completed photo, before lattice and variations; fields as in `Facade`."""

    image: UInt8Array
    labels: UInt8Array
    occluded: BoolArray
    masked: tuple[Box, ...]
    masked_share: float
    elements: tuple[Element, ...]
    completion: Completion | None
    estimates: FacadeEstimates


def build_facade_from_photo(
    image: UInt8Array,
    hidden: BoolArray,
    *,
    facade_mask: BoolArray | None = None,
    outside: BoolArray | None = None,
    private: BoolArray | None = None,
    clean: bool = False,
    entrances: Sequence[float] = (),
    front: bool = False,
    models: ModelFiles = SHIPPED_MODELS,
    seed: int = 0,
) -> Facade:
    """Run all stages on a rectified photo of a facade.

    Occluders that the parser finds are inpainted, so that no tree, face or number plate stays in the texture.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool pixels known not to show the facade.
    facade_mask : (h, w) bool pixels known to show the facade; no occluder is searched there.
    outside : (h, w) bool sky and street; the parser may use them as context.
    private : (h, w) bool faces and number plates.
    clean : True for a photo without occluders.
    entrances : positions of mapped doors as shares of the width.
    front : True for a wall on a street (`complete`).
    models : models of parser and layout.
    seed : seed of completion and inpainting.

    Raises
    ------
    ImageError
        If less than MIN_VISIBLE_SHARE of the facade is visible.
    """
    seconds: dict[str, float] = {}
    made = _complete_photo(
        image,
        hidden,
        seconds,
        facade_mask=facade_mask,
        outside=outside,
        private=private,
        clean=clean,
        entrances=entrances,
        front=front,
        models=models,
        seed=seed,
    )
    with _timer(seconds, "lattice"):
        split = lattice(made.labels)
    with _timer(seconds, "encode"):
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
        floors=int(made.estimates.value.floors),
        seconds=seconds,
    )


def _complete_photo(
    image: UInt8Array,
    hidden: BoolArray,
    seconds: dict[str, float],
    *,
    facade_mask: BoolArray | None = None,
    outside: BoolArray | None,
    private: BoolArray | None,
    clean: bool,
    entrances: Sequence[float] = (),
    front: bool = False,
    models: ModelFiles,
    seed: int,
) -> _CompletedPhoto:
    """Parse and complete a photo; add the seconds of its stages to `seconds`."""
    _require_visible(hidden, "of it")
    with _timer(seconds, "parse"):
        alpha = np.where(hidden, 0, 255).astype(np.uint8)
        parsing = parse(np.dstack([image, alpha]), model=models.parser)
        occluded = np.zeros_like(hidden) if clean else remove_spill(parsing.occluded, hidden)
        if facade_mask is not None:
            occluded &= ~facade_mask
        occluders, masked = occluder_mask(occluded)
        if private is not None:
            occluders |= private
        masked_share = float((occluders & ~hidden).mean())
        hidden = hidden | occluders
        if outside is not None:
            hidden |= dilate(outside, OCCLUDER_RIM_SHARE)
    _require_visible(hidden, "beside sky, trees, cars and the like")
    with _timer(seconds, "elements"):
        observed = [e for e in elements(parsing) if box_coverage(hidden, e) <= MAX_HIDDEN_SHARE]
    completion, result_parsing, result, layout = None, parsing, image, observed
    if hidden.any():
        height, width = hidden.shape
        with _timer(seconds, "complete"):
            if observed:
                region = visible_boxes(dilate_by_window(hidden, observed))
                region += [(e.x0, e.y0, e.x1, e.y1) for e in observed]
                evidence = replace(parsing, occluded=hidden | parsing.occluded)
                completion = complete(
                    observed,
                    (0, 0, width, height),
                    region,
                    seed=seed,
                    evidence=evidence,
                    entrances=[share * width for share in entrances],
                    front=front,
                    model=None if models.layout is None else layouts.load_cached_model(models.layout),
                )[0]
                layout = list(completion.elements)
        with _timer(seconds, "inpaint"):
            result = inpaint(image, hidden, labels=parsing.labels, elements=list(layout), method="floors", seed=seed)
        # Labels and elements come from the completed picture, which may differ from the planned layout.
        with _timer(seconds, "parse"):
            result_parsing = parse(result, model=models.parser)
        with _timer(seconds, "elements"):
            layout = elements(replace(result_parsing, occluded=np.zeros_like(hidden)))
    calibration = load_calibration(models.parser)
    estimates = calibration.estimate(result_parsing, layout, hidden)
    layout = calibrate_elements(layout, calibration, hidden)
    return _CompletedPhoto(
        result, result_parsing.labels, hidden, masked, masked_share, tuple(layout), completion, estimates
    )


def _require_visible(hidden: BoolArray, cause: str) -> None:
    seen = 1 - hidden.mean()
    if seen < MIN_VISIBLE_SHARE:
        raise ImageError(
            f"only {seen:.1%} of the facade is seen {cause}, and {MIN_VISIBLE_SHARE:.0%} are the least; "
            "give a photo that shows more of it, or none"
        )


def prepare_exemplar(
    image: UInt8Array,
    hidden: BoolArray,
    *,
    floor_height: float,
    private: BoolArray | None = None,
    labels: UInt8Array | None = None,
    models: ModelFiles = SHIPPED_MODELS,
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
    models : models of parser and layout.
    seed : seed of completion and inpainting.

    Raises
    ------
    ImageError
        If too little of the facade is visible, or no window.
    """
    seconds: dict[str, float] = {}
    if labels is not None and not hidden.any() and (private is None or not private.any()):
        evidence = completed = image
        box, has_facade, occluded = (0, 0, image.shape[1], image.shape[0]), True, hidden
        with _timer(seconds, "elements"):
            measured, classes = _shrink_to_side(image, labels, MAX_COUNTING_SIDE_PX)
            floors, layout = count_floors(classes), tuple(elements(classes))
    else:
        cut = crop_to_facade(image, hidden, model=models.parser)
        has_facade = cut.has_facade
        x0, y0, x1, y1 = box = cut.box
        private = None if private is None else private[y0:y1, x0:x1]
        whole = _complete_photo(
            cut.image, cut.hidden, seconds, outside=cut.outside, private=private, clean=False, models=models, seed=seed
        )
        evidence, completed, labels, occluded = cut.image, whole.image, whole.labels, whole.occluded
        floors, layout, measured, classes = int(whole.estimates.value.floors), whole.elements, whole.image, labels
    if not floors:
        raise ImageError("no windows are found in it, of which walls could be made; replace or remove it")
    with _timer(seconds, "scale"):
        scale = exemplar_scale(completed, labels, storey=floor_height)
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
        shaded_share=shadow_share(measured, classes),
        seconds=seconds,
    )


def _shrink_to_side(image: UInt8Array, labels: UInt8Array, longest: int) -> tuple[UInt8Array, UInt8Array]:
    """Shrink an image (h, w, 3) and its labels (h, w) until no side is longer than `longest` pixels."""
    share = longest / max(labels.shape)
    if share >= 1:
        return image, labels
    height, width = (max(1, round(side * share)) for side in labels.shape)
    return resize_with_labels(image, labels, (height, width))


def build_facade_from_exemplar(
    style: ExemplarStyle,
    wall: FacadeWall,
    size: tuple[int, int],
    *,
    span: tuple[float, float] | None = None,
    floor_style: ExemplarStyle | None = None,
    metres_per_pixel: float,
    building_seed: int = 0,
    wall_colour: Float64Array | None = None,
    seed: int = 0,
) -> Facade:
    """Build a wall without imagery in the style of an exemplar.

    Walls on no street get no hierarchy; texels behind a neighbour are marked as unseen.

    Parameters
    ----------
    style : analysed exemplar.
    wall : metric wall.
    size : (h, w) of the raster to fill.
    span : left and right end, metres, of the part of a wall that turns a bend; the whole wall by default.
    floor_style : exemplar whose floor heights apply; `style` by default.
    metres_per_pixel : scale of the exemplar; may be finer or coarser than the raster.
    building_seed : seed of the shade of the paint, common to a building.
    wall_colour : (3,) 0..255, colour of the building's walls where photos of other walls show it.
    seed : seed of the composition and of the panes.
    """
    import cv2

    seconds: dict[str, float] = {}
    with _timer(seconds, "retarget"):
        left, right = span or (0.0, wall.width)
        # A back with a door needs full resolution too: the joints of the door are finer than a texel.
        full_resolution = wall.on_street or wall.has_back_door
        texel = wall.height / size[0]
        pixel = metres_per_pixel if full_resolution else max(metres_per_pixel, texel / OVERSAMPLING)
        texture, labels = compose_wall(
            style,
            wall,
            floor_style=floor_style,
            metres_per_pixel=metres_per_pixel,
            output_metres_per_pixel=pixel,
            texel_m=texel,
            seed=seed,
        )
        columns = slice(round(left / pixel), max(round(left / pixel) + 1, round(right / pixel)))
        texture, labels = resize_image(np.ascontiguousarray(texture[:, columns]), size), labels[:, columns]
        if labels.shape != size:
            labels = np.asarray(cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST), labels.dtype)
    with _timer(seconds, "elements"):
        layout = tuple(elements(labels))
    hierarchy = varied = None
    with _timer(seconds, "vary"):
        if wall.on_street:
            # Permute window states between walls of one exemplar and between repeated bays.
            texture, varied = exchange_in_photo(texture, find_variations(texture, layout), EXCHANGE_LEVEL, seed)
        texture = tint_facade(
            texture, labels, building_seed=building_seed, seed=seed, paint=_paint_factors(texture, labels, wall_colour)
        )
    with _timer(seconds, "lattice"):
        split = lattice(labels)
    if varied is not None:
        with _timer(seconds, "encode"):
            hierarchy = encode_variations(texture, varied)
    known = np.ones(size, bool) if wall.on_street else _free_mask(wall, (left, right), size)
    return Facade(
        evidence=texture,
        image=texture,
        labels=labels,
        occluded=np.zeros(size, bool),
        provenance=np.where(known, Provenance.SYNTHESISED, Provenance.UNSEEN).astype(np.uint8),
        masked=(),
        masked_share=0.0,
        lattice=split,
        elements=layout,
        hierarchy=hierarchy,
        completion=None,
        estimates=None,
        floors=count_floors(labels),
        seconds=seconds,
    )


def _paint_factors(texture: UInt8Array, labels: UInt8Array, colour: Float64Array | None) -> Float64Array | None:
    """Return (3,) factors that bring a texture's wall to a colour; None without a wall or a colour."""
    is_wall = labels == FacadeClass.WALL
    if colour is None or not is_wall.any():
        return None
    return np.asarray(
        np.clip(colour / np.maximum(lit_colour(texture[is_wall]), 1), 1 / MAX_PAINT_FACTOR, MAX_PAINT_FACTOR)
    )


def _free_mask(wall: FacadeWall, span: tuple[float, float], size: tuple[int, int]) -> BoolArray:
    """Mark, (h, w) bool, the texels of a part of a wall that no neighbour covers."""
    import cv2

    mask = np.zeros(size, np.uint8)
    scale = np.array([size[1] / (span[1] - span[0]), size[0] / wall.height])
    for polygon in shapely.get_parts(wall.free.buffer(FREE_MARGIN_M)):
        rings = [polygon.exterior, *polygon.interiors]
        corners = [np.rint((shapely.get_coordinates(ring) - [span[0], 0]) * scale).astype(np.int32) for ring in rings]
        cv2.fillPoly(mask, corners[:1], 1)
        if corners[1:]:
            cv2.fillPoly(mask, corners[1:], 0)
    return mask.astype(bool)


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


@contextmanager
def _timer(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
