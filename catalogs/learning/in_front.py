"""Boxes of the vehicles and people that a detector found before photos that are trained on.

The labels of ECP and CMP say nothing of them. in_front.json keeps the boxes, in_front.md says where they come from.
"""

from __future__ import annotations

import json
from pathlib import Path

_BOXES = Path(__file__).with_name("in_front.json")


def boxes_in_front() -> dict[str, list[tuple[int, int, int, int]]]:
    """The detector's boxes (x0, y0, x1, y1) in pixels, half-open, by set and photo, as "ecp/monge_101"; every photo that it
    looked at has an entry."""
    found = json.loads(_BOXES.read_text(encoding="utf-8"))
    return {name: [tuple(box) for box in boxes] for name, boxes in found.items()}
