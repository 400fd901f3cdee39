"""Ranked completions of the picture of a facade or of a partly observed layout, as JSON and as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catalogs.readers.layouts import read_partial_layout
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.types import Completion
from facade_core.export.pictures.rendering import ElementRow, draw_layout, encode_image
from facade_core.facade.evidence import Evidence
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.photo_facade import observe_photo
from tasks.stages.shared.images import read_image_and_mask

LAYOUT_SUFFIXES = (".json", ".jsonl")


# Longer side of the drawing of a layout without a picture, pixels.
DRAWING_SIDE_PX = 640
# Grey levels of the visible and of the hidden part of such a drawing.
_VISIBLE_GREY = 225
_HIDDEN_GREY = 170


@dataclass(frozen=True, slots=True, eq=False)
class _Drawing:
    """Ground on which completions are drawn: a picture (h, w, 3), its hidden part, and the frame of the elements."""

    image: UInt8Array
    hidden: BoolArray
    domain: Rectangle

    def draw(self, completion: Completion) -> UInt8Array:
        """Draw a completion: seen elements are outlined, added ones are filled."""
        x0, y0, x1, y1 = self.domain
        height, width = self.hidden.shape
        across, down = width / (x1 - x0), height / (y1 - y0)
        rows: list[ElementRow] = [
            (e.label, (e.x0 - x0) * across, (e.y0 - y0) * down, (e.x1 - x0) * across, (e.y1 - y0) * down, e.confidence)
            for e in completion.elements
        ]
        return draw_layout(self.image, self.hidden, rows)


def complete_file(path: Path, count: int, pictures: Path | None = None) -> JsonObject:
    """Complete the layout of a picture or of a layout file and return the ranked completions.

    Transparent pixels of a picture are hidden, and those of the occluders that the parser finds.

    Parameters
    ----------
    path : rectified picture of a facade, or JSON object of a layout, as `read_partial_layout` reads it.
    count : largest number of completions.
    pictures : folder for a picture of each completion, created if needed; None to draw none.

    Returns
    -------
    `domain` and `completions`, best first: `score`, `objects` with label, corners, confidence and `is_observed`, and
    `picture`, the file, if one was drawn.

    Raises
    ------
    InputError
        For a file that is no picture or layout, or a folder that cannot be written.
    """
    if path.suffix.lower() in LAYOUT_SUFFIXES:
        layout = read_partial_layout(path)
        observed, domain = list(layout.elements), layout.domain
        found = complete(observed, domain, layout.visible, n=count)
        drawing = _blank_drawing(domain, layout.visible)
    else:
        image, hidden = read_image_and_mask(path)
        photo = observe_photo(Evidence(image=image, hidden=hidden))
        observed, domain = list(photo.elements), (0.0, 0.0, float(image.shape[1]), float(image.shape[0]))
        found = complete(observed, domain, photo.visible_boxes(), n=count, evidence=photo.occluded_parsing())
        drawing = _Drawing(image, photo.hidden, domain)
    files = [None] * len(found) if pictures is None else _write_pictures(drawing, found, pictures)
    return {
        "domain": list(domain),
        "completions": [
            _describe(one, len(dict.fromkeys(observed))) | ({} if file is None else {"picture": str(file)})
            for one, file in zip(found, files, strict=True)
        ],
    }


def _blank_drawing(domain: Rectangle, visible: Sequence[Rectangle]) -> _Drawing:
    """Return a grey ground for a layout without a picture, darker where it is hidden."""
    x0, y0, x1, y1 = domain
    scale = DRAWING_SIDE_PX / max(x1 - x0, y1 - y0)
    size = max(1, round((y1 - y0) * scale)), max(1, round((x1 - x0) * scale))
    hidden = np.ones(size, bool)
    for a0, b0, a1, b1 in visible:
        rows, columns = ((b0 - y0) * scale, (b1 - y0) * scale), ((a0 - x0) * scale, (a1 - x0) * scale)
        hidden[tuple(slice(*(max(0, round(end)) for end in span)) for span in (rows, columns))] = False
    grey = np.where(hidden, _HIDDEN_GREY, _VISIBLE_GREY).astype(np.uint8)
    return _Drawing(np.repeat(grey[..., None], 3, axis=2), hidden, domain)


def _write_pictures(drawing: _Drawing, found: Sequence[Completion], folder: Path) -> list[Path]:
    """Write a PNG file of each completion, numbered by rank; returns the files."""
    files = [folder / f"completion-{rank}.png" for rank in range(1, len(found) + 1)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file, completion in zip(files, found, strict=True):
            file.write_bytes(encode_image(drawing.draw(completion), "PNG"))
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); name another folder") from error
    return files


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
