"""Memory of units: upper bounds in bytes, besides libraries and the run's plan.

Declared from sizes that the coordinator knows before the unit starts. Batches are sized by it; a test measures the bounds.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from facade_core.core.errors import InputError
from facade_core.core.types import TrainedModelFiles
from facade_core.imagery.detect.detection import detectors_available
from tasks.stages.shared.images import MAX_PIXELS, image_size

# Libraries take this much once, for any size.
LIBRARY_BYTES = 50_000_000
# Bytes per texel of a facade: votes, features and copies (measured: 165 from 0.5 to 4 million texels).
FACADE_TEXEL = 190
# Networks that detect faces and text work on one part of a picture at a time (measured: 280 to 340 MB).
DETECTION_BYTES = 350_000_000
# Activations of each network that a block gives, beside its weights (an estimate: not measured, and networks differ).
GIVEN_NETWORK_BYTES = 1_000_000_000
# While a network is loaded, its file, its graph and its prepared weights are in memory (an estimate).
LOADED_NETWORK_SHARE = 3
# Bytes per pixel of a picture that is decoded, and of the bounded copy that is converted and masked
# (measured: 5 to 6 of a PNG of 144 megapixels, 7 of a progressive JPEG).
DECODED_PIXEL = 4
PICTURE_PIXEL = 12
# Bytes per finished texel that waits for the others of its unit, with its copy on the way to the store.
FINISHED_TEXEL = 10
# Bytes per texel of ground or of a wall from panoramas.
GROUND_TEXEL = 60
# Bytes per texel that each panorama shows.
VIEW_TEXEL = 30
# Bytes per pixel of a panorama with the mask of its occluders.
CAMERA_PIXEL = 8


def detector_memory() -> int:
    """Return the bytes of the optional detectors; 0 if they are not installed."""
    return DETECTION_BYTES if detectors_available() else 0


def given_network_memory(models: TrainedModelFiles) -> int:
    """Return the bytes of the networks that a block gives and the project does not ship."""
    given = [path for path in (models.segmentation, models.inpainting) if path is not None]
    return sum(GIVEN_NETWORK_BYTES + LOADED_NETWORK_SHARE * path.stat().st_size for path in given)


def bounded_pixel_count(pictures: Iterable[Path]) -> int:
    """Count the pixels of pictures as held in memory, each at most MAX_PIXELS."""
    return sum(min(count, MAX_PIXELS) for count in map(_picture_pixels, pictures))


def peak_decoding_bytes(pictures: Iterable[Path]) -> int:
    """Return the bytes of the largest picture while it is decoded and reduced; 0 if none is reduced."""
    largest = max(map(_picture_pixels, pictures), default=0)
    return largest * DECODED_PIXEL if largest > MAX_PIXELS else 0


def _picture_pixels(path: Path) -> int:
    """Return the pixels of a picture, by its header; 0 for a broken one, which fails when its unit reads it."""
    try:
        rows, columns = image_size(path)
    except (InputError, OSError):
        return 0
    return rows * columns
