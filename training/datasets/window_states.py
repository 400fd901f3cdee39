"""States of windows of labelled photos, marked by eye: window_states.json, described in window_states.md."""

from __future__ import annotations

import json
from pathlib import Path

Box = tuple[int, int, int, int]

_STATES_FILE = Path(__file__).with_name("window_states.json")


def read_window_states() -> dict[str, dict[Box, str]]:
    """Return the state of each marked window by its box, by set and photo such as "ecp/monge_101"."""
    photos = json.loads(_STATES_FILE.read_text(encoding="utf-8"))
    return {name: {(x0, y0, x1, y1): state for x0, y0, x1, y1, state in windows} for name, windows in photos.items()}
