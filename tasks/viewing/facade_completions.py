"""Ranked completions of a facade's layout for the correction editor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from catalogs.block.correction_values import Box, ElementBox, parse_correction_value
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.provenance import Provenance
from facade_core.core.types import Element, Parsing, TrainedModelFiles
from facade_core.facade.correction import rasterise_boxes
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.model import load_cached_model
from facade_core.facade.layout.visible_region import dilate_hidden_by_window, visible_region_boxes
from facade_core.facade.photo_facade import MAX_HIDDEN_SHARE
from facade_core.geometry.walls import WallRole
from facade_core.parsing.confidence import box_coverage
from facade_core.parsing.segmenter import parse
from tasks.viewing.run_view import RunView

# Completions that the editor offers.
COMPLETION_COUNT = 5


@dataclass(frozen=True, slots=True)
class EditorBoxes:
    """Boxes of a facade as the editor shows them, as shares of the wall.

    Attributes
    ----------
    facade : id of the facade.
    elements : boxes of elements.
    drawn : of each element, whether the user drew or moved it; such an element stays in any completion.
    hide : parts of the picture that do not show the facade.
    """

    facade: str
    elements: tuple[ElementBox, ...]
    drawn: tuple[bool, ...]
    hide: tuple[Box, ...]


def parse_editor_boxes(body: object) -> EditorBoxes:
    """Parse the boxes that the editor sends.

    Raises
    ------
    ValueError, InputError : a value is malformed.
    """
    try:
        fields = cast(JsonObject, body)
        facade = str(fields["facade"])
        rows = [(element, drawn is True) for *element, drawn in fields["elements"]]
        hide = parse_correction_value(facade, "hide", fields.get("hide")) or ()
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(
            'what is completed is {"facade": ID, "elements": [[CLASS, LEFT, TOP, RIGHT, BOTTOM, IS_DRAWN]]}'
        ) from error
    parsed = [cast(tuple[ElementBox], parse_correction_value(facade, "elements", [element])) for element, _ in rows]
    return EditorBoxes(
        facade,
        tuple(element for (element,) in parsed),
        tuple(drawn for _, drawn in rows),
        cast(tuple[Box, ...], hide),
    )


def complete_facade(view: RunView, index: int, boxes: EditorBoxes, models: TrainedModelFiles) -> JsonObject:
    """Complete the hidden part of a facade from its visible and its drawn elements.

    Other elements in the hidden part are guesses of an earlier completion and are replaced.

    Parameters
    ----------
    view : snapshot of the run.
    index : index of the facade.
    boxes : boxes of the editor.
    models : models of the block.

    Returns
    -------
    kept : indices of the elements that every completion has.
    completions : best first, each `score` and `elements`, the added [class, left, top, right, bottom], texels.

    Raises
    ------
    InputError : no element is visible or drawn, or an element is outside the wall.
    """
    facade = view.open_facade(index)
    pictured = facade.read_raster("atlas/seed_evidence") == Provenance.PHOTO
    height, width = pictured.shape
    hidden = ~pictured | rasterise_boxes(boxes.hide, pictured.shape)
    elements = [
        Element(name, x0 * width, y0 * height, x1 * width, y1 * height) for name, x0, y0, x1, y1 in boxes.elements
    ]
    kept = [
        k
        for k, (element, drawn) in enumerate(zip(elements, boxes.drawn, strict=True))
        if drawn or box_coverage(hidden, element) <= MAX_HIDDEN_SHARE
    ]
    if not kept:
        raise InputError(f"{boxes.facade}: no element of it is seen or drawn; draw one box, then complete again")
    observed = list(dict.fromkeys(elements[k] for k in kept))
    evidence = None if hidden.all() else _parse_visible(facade.read_raster("atlas/seed"), hidden, models)
    completions = complete(
        observed,
        (0.0, 0.0, float(width), float(height)),
        visible_region_boxes(dilate_hidden_by_window(hidden, observed)) + [(e.x0, e.y0, e.x1, e.y1) for e in observed],
        n=COMPLETION_COUNT,
        model=None if models.layout is None else load_cached_model(models.layout),
        evidence=evidence,
        front=int(view.tables.facades.role[index]) == WallRole.STREET,
    )
    return {
        "kept": kept,
        "completions": [
            {
                "score": round(completion.score, 4),
                "elements": [
                    [e.label, *(round(side, 2) for side in (e.x0, e.y0, e.x1, e.y1))]
                    for e in completion.elements[len(observed) :]
                ],
            }
            for completion in completions
        ],
    }


def _parse_visible(image: UInt8Array, hidden: BoolArray, models: TrainedModelFiles) -> Parsing:
    """Parse the visible part of a facade (h, w, 3) uint8."""
    alpha = np.where(hidden, 0, 255).astype(np.uint8)
    parsing = parse(np.dstack([image, alpha]), model=models)
    return replace(parsing, occluded=hidden | parsing.occluded)
