"""Facades with labels, and the elements that those say."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from facade_core.core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.core.types import Element


def elements_of(labels: np.ndarray, *, smallest: int = 40) -> list[Element]:
    """Boxes of the connected components of window, balcony, door and shop with at least `smallest` pixels."""
    from skimage.measure import label, regionprops

    found = []
    for name in ELEMENT_CLASSES:
        for region in regionprops(label(labels == CLASSES.index(name))):
            y0, x0, y1, x1 = region.bbox
            if region.area >= smallest and min(y1 - y0, x1 - x0) >= 4:
                found.append(Element(name, x0, y0, x1, y1))
    return found


def facades(folder: Path, every: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Every n-th facade of a folder with images/ and labels/ (ids as in CLASSES): name, image, labels."""
    for path in sorted((folder / "images").iterdir())[::every]:
        labels = np.asarray(Image.open(folder / "labels" / f"{path.stem}.png"))
        yield path.stem, np.asarray(Image.open(path).convert("RGB")), labels
