"""Detected vehicles and people in front of the facades of training photos.

The labels of ECP and CMP do not state them. in_front.json holds the boxes, in_front.md their origin.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

Box = tuple[int, int, int, int]

_BOXES_FILE = Path(__file__).with_name("in_front.json")


class OccluderBoxes(NamedTuple):
    """Boxes (x0, y0, x1, y1) in pixels of a photo, half-open: detections, and doubtful ones."""

    found: Sequence[Box]
    doubtful: Sequence[Box] = ()


def read_occluder_boxes() -> dict[str, OccluderBoxes]:
    """Return the boxes of each examined photo, by set and photo such as "ecp/monge_101"."""
    photos = json.loads(_BOXES_FILE.read_text(encoding="utf-8"))
    return {
        name: OccluderBoxes(*([tuple(box) for box in entry[kind]] for kind in ("found", "doubtful")))
        for name, entry in photos.items()
    }
