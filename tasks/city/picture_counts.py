"""Pictures of a block by number and size, read from their headers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from catalogs.readers.pictures.folders import label_map_path
from facade_core.core.errors import InputError
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE, MAX_PIXELS, image_size


@dataclass(frozen=True)
class PictureCounts:
    """Pictures, and the millions of their pixels that are parsed."""

    pictures: int
    parsed_megapixels: float


def count_exemplars(paths: Sequence[Path]) -> PictureCounts:
    """Count exemplars; those with a label map are not parsed."""
    parsed = sum(_exemplar_megapixels(path) for path in paths if label_map_path(path) is None)
    return PictureCounts(len(paths), parsed)


def photo_megapixels(path: Path) -> float:
    """Return the millions of pixels of a photo as it is parsed; 0 if it cannot be opened, which its unit reports."""
    height, width = _picture_size(path)
    return min(height * width, MAX_PIXELS) / 1e6


def _exemplar_megapixels(path: Path) -> float:
    height, width = _picture_size(path)
    shrink = min(1.0, MAX_EXEMPLAR_SIDE / max(height, width, 1))
    return height * width * shrink**2 / 1e6


def _picture_size(path: Path) -> tuple[int, int]:
    try:
        return image_size(path)
    except InputError:
        return 0, 0
