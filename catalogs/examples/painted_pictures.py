"""Painted exemplars and photos that come with the project."""

from __future__ import annotations

import filecmp
from pathlib import Path

# Folders `exemplars`, a style library, and `photos` of facades of the demo (`benchmarks.painter.paint_demo`).
PAINTED_PICTURES = Path(__file__).parent / "painted"
PAINTED_LICENCE = "the Streetloom developers, Apache-2.0"


def is_painted(path: Path) -> bool:
    """Return whether a file is one of the painted pictures or of their label maps, by name and content."""
    shipped = (PAINTED_PICTURES / folder / path.name for folder in ("exemplars", "photos"))
    return path.is_file() and any(one.is_file() and filecmp.cmp(one, path, shallow=False) for one in shipped)
