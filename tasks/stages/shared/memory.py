"""What a unit takes of a worker's memory at most, in bytes, beside the libraries and the run's plan.

Declared from sizes that the coordinator knows before the unit starts; batches are sized by it, and a test measures that the
parser and the rest stay below it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from facade_core.core.errors import InputError
from facade_core.export.models.pages import LARGEST_PAGE
from facade_core.export.pictures.views import SAMPLES, VIEW_SIZE
from facade_core.imagery.detect.detection import looked_for
from facade_core.imagery.poses.joint_refinement import WIDEST
from facade_core.street.translator.neural import NETWORK_PIXELS
from tasks.stages.facades.imagery import Imagery
from tasks.stages.shared.images import LONGEST_EXEMPLAR, MOST_PIXELS, image_size

# What libraries take once, whatever the size.
LEAST = 50_000_000
# Stages of a facade hold votes, features and copies of each texel (measured: 165 from 0.5 to 4 million).
FACADE_TEXEL = 190
# Networks that look for faces and text, at work on one part of a picture, whatever its size (measured: 280 to 340 MB).
LOOKING = 350_000_000
# A texture's colour, cover and places in the atlas.
TEXTURE_TEXEL = 40
# A picture is decoded; what is kept of it, which is bounded, is converted and given a mask (measured: 5 to 6 of a PNG of 144
# megapixels, 7 of a progressive JPEG).
DECODED_PIXEL = 4
PICTURE_PIXEL = 12
# A panorama whose pose is refined: the picture, and edges of it at a smaller size.
POSE_PIXEL = 24
# What is kept of one that is refined together with others.
KEPT_PANORAMA = WIDEST * WIDEST // 2 * 3
# A pixel that the neural translator works on: what its taps see and its widest layers (measured: 1700 to 1900).
NETWORK_PIXEL = 2000
# The window of a street: seed, colour and provenance of a texel it reads; with the blend state of one it writes (measured: 61
# to 64 in all).
READ_TEXEL, WRITTEN_TEXEL = 16, 64
# A finished texel that waits for the others of its unit, with its copy on the way to the store; one that is painted and
# levelled, with what is around it (measured: 150).
FINISHED_TEXEL, SURFACE_TEXEL = 10, 155
# A texel on which pictures go on by example, with what lies around it; and what its sources are chosen from, for a
# whole piece (measured: 187 MB of 640,000 texels, 106 of 260,000).
CONTINUED_TEXEL, CONTINUED = 300, 50_000_000

# A texel of ground or of a wall from panoramas, one that each of these shows, and a pixel of them with what hides it.
GROUND_TEXEL, VIEW_TEXEL, CAMERA_PIXEL = 60, 30, 8

# A page that is coloured between its charts: means of ever larger squares of it, as floats. A picture of a tile: the rasters of
# its charts, the picture, and what of it is free; and the tile's encoded bytes, as pictures and as a model.
PAGE_TEXEL, PICTURE_TEXEL, TILE_TEXEL = 40, 16, 1
# A ray of a view: depth, place, and what it shows (measured: 30 to 40, where two in five meet the block). A texel of a facade
# whose stages are drawn, one after the other (measured: 66 to 80).
VIEW_RAY, DRAWN_TEXEL = 60, 90


def pose_memory(path: Path) -> int:
    return LEAST + _decoded([path]) + _pixels([path]) * POSE_PIXEL


def bundle_memory(paths: Sequence[Path]) -> int:
    """Of panoramas that are refined together: each is read in turn, and kept small."""
    widest = max((pose_memory(path) for path in paths), default=LEAST)
    return widest + len(paths) * KEPT_PANORAMA


def exemplar_memory(path: Path) -> int:
    kept = min(_pixels([path]), LONGEST_EXEMPLAR**2)
    return LEAST + _looking() + max(_decoded([path]) + kept * PICTURE_PIXEL, kept * (FACADE_TEXEL + PICTURE_PIXEL))


def facade_memory(texels: int, imagery: Imagery) -> int:
    panoramas = [path for path, _ in (*imagery.panoramas, *imagery.earlier)]
    tried = ([imagery.photo] if imagery.photo else [], panoramas)  # one after the other
    kept = max(_pixels(pictures) for pictures in tried)
    least = LEAST + (_looking() if kept else 0)
    return least + max(texels * FACADE_TEXEL, *map(_decoded, tried)) + kept * PICTURE_PIXEL


def _looking() -> int:
    return LOOKING if looked_for() else 0


def texture_memory(texels: int, pictures: Sequence[Path]) -> int:
    return LEAST + max(texels * TEXTURE_TEXEL, _decoded(pictures)) + _pixels(pictures) * PICTURE_PIXEL


def surface_memory(texels: np.ndarray, *, continued: bool = False) -> int:
    """Of a building or piece of ground whose charts have so many texels (k,): all are kept, one at a time is levelled.
    continued: whether pictures go on by example there."""
    example = CONTINUED + int(texels.max()) * CONTINUED_TEXEL if continued else 0
    return LEAST + int(texels.sum()) * FINISHED_TEXEL + int(texels.max()) * SURFACE_TEXEL + example


def ground_memory(texels: int, pictures: Sequence[Path]) -> int:
    """Of a piece of ground of so many texels, from so many panoramas."""
    kept = _pixels(pictures)
    return LEAST + _looking() + texels * (GROUND_TEXEL + len(pictures) * VIEW_TEXEL) + kept * CAMERA_PIXEL


def wall_memory(texels: np.ndarray, pictures: Sequence[Sequence[Path]]) -> int:
    """Of a building whose charts, of so many texels (k,), are each taken from some panoramas: what these show is kept, one
    chart at a time is taken, from its own panoramas."""
    pixels = {path: _pixels([path]) for path in {path for of_chart in pictures for path in of_chart}}
    taken = (
        count * (GROUND_TEXEL + len(of_chart) * VIEW_TEXEL) + sum(pixels[path] for path in of_chart) * CAMERA_PIXEL
        for count, of_chart in zip(texels.tolist(), pictures, strict=True)
    )
    return LEAST + _looking() + int(texels.sum()) * FINISHED_TEXEL + max(taken)


def page_memory(texels: int) -> int:
    return LEAST + texels * PAGE_TEXEL


def tile_memory(texels: int) -> int:
    return LEAST + LARGEST_PAGE**2 * PICTURE_TEXEL + texels * TILE_TEXEL


def view_memory(page: int) -> int:
    """Of a view of the block, painted from pages of so many texels."""
    return LEAST + int(np.prod(VIEW_SIZE)) * SAMPLES**2 * VIEW_RAY + page * DECODED_PIXEL


def facade_pictures_memory(texels: int) -> int:
    return LEAST + texels * DRAWN_TEXEL


def street_memory(read: int, written: int, *, network: int = 0) -> int:
    """Of a street that sees so many texels and writes so many of them; network: pixels of a panorama for the network."""
    return LEAST + read * READ_TEXEL + written * WRITTEN_TEXEL + min(network, NETWORK_PIXELS) * NETWORK_PIXEL


def _pixels(pictures: Iterable[Path]) -> int:
    """Pixels that are kept of pictures."""
    return sum(min(count, MOST_PIXELS) for count in map(_stored, pictures))


def _decoded(pictures: Iterable[Path]) -> int:
    """What the largest of pictures takes while it is decoded and reduced; nothing where none is larger than what is kept."""
    largest = max(map(_stored, pictures), default=0)
    return largest * DECODED_PIXEL if largest > MOST_PIXELS else 0


def _stored(path: Path) -> int:
    """Pixels of a picture, by its header; a broken one takes none, and fails by name when its unit reads it."""
    try:
        rows, columns = image_size(path)
    except (InputError, OSError):
        return 0
    return rows * columns
