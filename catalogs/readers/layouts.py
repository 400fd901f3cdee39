"""Facade layouts in JSON: size and labelled rectangles of a facade."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.json_text import parse_json_object
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import read_regular
from facade_core.core.types import Element

# Labels of layout files -> classes of facade_core.core.labels; other labels are dropped and counted.
LAYOUT_LABELS: Mapping[str, str] = {
    "window": "window",
    "balcony": "balcony",
    "balcony-fence": "balcony",
    "door": "door",
    "shop": "shop",
    "store": "shop",
}
# Rectangles of this label span the domain of the facade, if a file has them.
_FACADE_LABEL = "facade"


@dataclass(frozen=True, slots=True)
class LayoutRecord:
    """Layout of one facade, in the file's unit, y down.

    Attributes
    ----------
    name : picture or source, and line number.
    elements : rectangles inside the domain.
    domain : the facade, (x0, y0, x1, y1).
    dropped : (label, count) of rectangles without a class or an area, or outside.
    """

    name: str
    elements: tuple[Element, ...]
    domain: tuple[float, float, float, float]
    dropped: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class PartialLayout:
    """Partly observed layout: visible elements, domain and visible boxes."""

    elements: tuple[Element, ...]
    domain: tuple[float, float, float, float]
    visible: tuple[tuple[float, float, float, float], ...]


def read_partial_layout(path: str | Path) -> PartialLayout:
    """Read a partly observed layout: one JSON object with width, height, objects and the boxes `visible`.

    Without `visible` only the elements themselves are visible.

    Raises
    ------
    InputError : the file cannot be read, or is no layout.
    """
    path = Path(path)
    with wrap_reader_errors(f"{path}:", "is no layout", "correct it"):
        record = parse_json_object(read_regular(path), str(path))
        layout = parse_layout_record(record, 1)
        boxes = [tuple(float(box[side]) for side in ("x0", "y0", "x1", "y1")) for box in record.get("visible", ())]
        if not np.isfinite(boxes).all():
            raise ValueError("numbers must be finite")

    visible = [(x0, y0, x1, y1) for x0, y0, x1, y1 in boxes] or [(e.x0, e.y0, e.x1, e.y1) for e in layout.elements]
    return PartialLayout(layout.elements, layout.domain, tuple(visible))


def parse_layout_record(record: JsonObject, number: int) -> LayoutRecord:
    """Parse the layout of a record; `number` tells records of one file apart.

    Raises
    ------
    KeyError, TypeError, ValueError : the record is no layout.
    """
    width, height = float(record["width"]), float(record["height"])
    things = [
        (str(o["label"]), (float(o["x0"]), float(o["y0"]), float(o["x1"]), float(o["y1"]))) for o in record["objects"]
    ]
    if not np.isfinite([width, height, *(side for _, sides in things for side in sides)]).all():
        raise ValueError("numbers must be finite")
    walls = [sides for label, sides in things if label == _FACADE_LABEL] or [(0.0, 0.0, width, height)]
    x0, y0 = min(w[0] for w in walls), min(w[1] for w in walls)
    x1, y1 = max(w[2] for w in walls), max(w[3] for w in walls)
    if not (x0 < x1 and y0 < y1):
        raise ValueError("the facade has no area")
    dropped: Counter[str] = Counter()
    elements: dict[Element, None] = {}
    for label, (a0, b0, a1, b1) in things:
        if label == _FACADE_LABEL:
            continue
        inside = x0 <= (a0 + a1) / 2 <= x1 and y0 <= (b0 + b1) / 2 <= y1
        if label in LAYOUT_LABELS and a0 < a1 and b0 < b1 and inside:
            elements[Element(LAYOUT_LABELS[label], a0, b0, a1, b1)] = None
        else:
            dropped[label] += 1
    name = f"{record.get('image') or record.get('source') or 'layout'}#{number}"
    return LayoutRecord(name, tuple(elements), (x0, y0, x1, y1), tuple(sorted(dropped.items())))
