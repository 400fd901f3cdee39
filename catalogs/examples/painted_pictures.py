"""Painted exemplars and photos that come with the project."""

from __future__ import annotations

import filecmp
from pathlib import Path

from facade_core.core.facade_styles import FACADE_STYLES

# A style library, described in docs/styles.md, and photos of facades of the demo (`benchmarks.painter.paint_demo`).
PAINTED_PICTURES = Path(__file__).parent / "painted"
PAINTED_FOLDERS = (PAINTED_PICTURES / "exemplars", PAINTED_PICTURES / "photos")
PAINTED_LICENCE = "the Streetloom developers, Apache-2.0"


def is_painted(path: Path) -> bool:
    """Return whether a file is one of the painted pictures or of their label maps, by name and content."""
    shipped = (folder / path.name for folder in PAINTED_FOLDERS)
    return path.is_file() and any(one.is_file() and filecmp.cmp(one, path, shallow=False) for one in shipped)


def shipped_style(path: Path) -> str | None:
    """Return the facade style of a shipped exemplar, as of `facade_core.core.facade_styles`; None for other pictures."""
    style = path.stem.rpartition("-")[0]
    return style if style in FACADE_STYLES and is_painted(path) else None
