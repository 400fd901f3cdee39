"""What a detector found before photos that are trained on: vehicles and people.

The labels of ECP and CMP say nothing of them. in_front.json keeps the boxes, in_front.md says where they come from.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

Box = tuple[int, int, int, int]

_BOXES = Path(__file__).with_name("in_front.json")


class Looked(NamedTuple):
    """Boxes (x0, y0, x1, y1) in pixels of a photo, half-open: of what a detector found, and of what may be something."""

    found: Sequence[Box]
    doubtful: Sequence[Box] = ()


def looked_in_front() -> dict[str, Looked]:
    """What the detector says, by set and photo, as "ecp/monge_101"; every photo that it looked at has an entry."""
    photos = json.loads(_BOXES.read_text(encoding="utf-8"))
    return {
        name: Looked(*([tuple(box) for box in told[kind]] for kind in ("found", "doubtful")))
        for name, told in photos.items()
    }
