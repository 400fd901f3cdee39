"""Ranked completions of the picture of a facade or of a partly observed layout, as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.learning.layouts import read_partial_layout
from facade_core.core.json_types import JsonObject
from facade_core.facade.layout.completion import complete
from facade_core.facade.photo_facade import PhotoMasks, observe_photo
from tasks.stages.shared.images import read_image_and_mask

if TYPE_CHECKING:
    from facade_core.core.types import Completion

LAYOUT_SUFFIXES = (".json", ".jsonl")


def complete_file(path: Path, count: int) -> JsonObject:
    """Complete the layout of a picture or of a layout file and return the ranked completions.

    Transparent pixels of a picture are hidden, and those of the occluders that the parser finds.

    Parameters
    ----------
    path : rectified picture of a facade, or JSON object of a layout, as `read_partial_layout` reads it.
    count : largest number of completions.

    Returns
    -------
    `domain` and `completions`, best first: `score` and `objects` with label, corners, confidence and `is_observed`.

    Raises
    ------
    InputError
        For a file that is no picture or layout.
    """
    if path.suffix.lower() in LAYOUT_SUFFIXES:
        layout = read_partial_layout(path)
        observed, domain = list(layout.elements), layout.domain
        found = complete(observed, domain, layout.visible, n=count)
    else:
        image, hidden = read_image_and_mask(path)
        photo = observe_photo(image, hidden, PhotoMasks())
        observed, domain = photo.observed, (0.0, 0.0, float(image.shape[1]), float(image.shape[0]))
        found = complete(observed, domain, photo.visible_boxes(), n=count, evidence=photo.evidence())
    return {"domain": list(domain), "completions": [_describe(one, len(dict.fromkeys(observed))) for one in found]}


def _describe(completion: Completion, observed: int) -> JsonObject:
    """Return a completion as JSON; its first elements are the observed ones."""
    objects = [
        {
            "label": e.label,
            **{
                name: round(value, 2)
                for name, value in zip(("x0", "y0", "x1", "y1"), (e.x0, e.y0, e.x1, e.y1), strict=True)
            },
            "confidence": round(e.confidence, 3),
            "is_observed": k < observed,
        }
        for k, e in enumerate(completion.elements)
    ]
    return {"score": round(completion.score, 4), "objects": objects}
