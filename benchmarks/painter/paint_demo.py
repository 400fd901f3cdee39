"""Painting of the demo's pictures: `python -m benchmarks.painter.paint_demo` writes them anew into the package."""

from __future__ import annotations

import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.painter.exemplars import UPPER_FLOOR_HEIGHT_M, paint_exemplar
from benchmarks.painter.facade import PAINTED_STYLES, PaintedFacade, paint_facade
from benchmarks.painter.library_styles import LIBRARY_FACADES, LibraryFacade
from benchmarks.painter.styles import NORDIC_STYLES
from catalogs.block.reader import Block, read_block
from catalogs.block.settings import replace_settings
from catalogs.examples.painted_pictures import PAINTED_PICTURES
from facade_core.core.arrays import UInt8Array
from facade_core.geometry.walls import WallRole
from tasks.examples.demo import SEED, copy_map, write_block_file
from tasks.stages.ingest.planning import make_plan

# Painted walls of eight northern styles: facades of a perimeter block by their number as an exemplar.
PERIMETER_BLOCK = (2, 4, 5, 7, 10, 11, 12, 13, 15, 16, 19, 21, 23, 25, 27, 28, 29, 31, 32, 33, 34, 35, 36, 39)
# Finer than the block, so that the exemplars suit blocks of any texel density; the styles of the library need less.
EXEMPLAR_PIXELS_PER_METRE = 64
LIBRARY_PIXELS_PER_METRE = 40
# Of the seeds of neighbouring facades of a style, which gives them different colours.
SEED_STEP = 13
# Every third facade within PHOTO_METRES gets a painted photo with a hole.
PHOTO_EVERY = 3
PHOTO_PIXELS_PER_METRE = 32  # the minimum that resolves a course of bricks
# Widths of facades that get a photo, metres.
PHOTO_METRES = (6.0, 40.0)
# Quality of WebP: library and photos take 3.0 MB.
QUALITY = 80


def paint_exemplars(folder: Path, count: int | None = None) -> None:
    """Paint the style library, or its first `count` pictures, with its label images."""
    folder.mkdir(parents=True, exist_ok=True)
    paints = {
        f"perimeter-block-{place:02d}": partial(
            paint_exemplar, number, seed=SEED, metres_per_pixel=1 / EXEMPLAR_PIXELS_PER_METRE, styles=NORDIC_STYLES
        )
        for place, number in enumerate(PERIMETER_BLOCK)
    } | {
        f"{style}-{place:02d}": partial(paint_library_facade, facade, seed=SEED + SEED_STEP * place)
        for style, facades in LIBRARY_FACADES.items()
        for place, facade in enumerate(facades)
    }

    def paint(name: str) -> None:
        painted = paints[name]()
        _save(folder / f"{name}.webp", painted.image)
        Image.fromarray(painted.labels).save(folder / f"{name}.labels.png", optimize=True)

    with ThreadPoolExecutor(2) as threads:
        list(threads.map(paint, list(paints)[:count]))


def paint_library_facade(facade: LibraryFacade, *, seed: int) -> PaintedFacade:
    """Paint a facade of the library."""
    style = PAINTED_STYLES[facade.style]
    return paint_facade(
        (
            UPPER_FLOOR_HEIGHT_M * (facade.floors - 1 + style.ground_share) + style.crown,
            facade.columns * facade.column_m,
        ),
        floors=facade.floors,
        columns=facade.columns,
        style=facade.style,
        metres_per_pixel=1 / LIBRARY_PIXELS_PER_METRE,
        seed=seed,
    )


def paint_photos(block: Block, folder: Path) -> None:
    """Paint a photo of every third facade with its own size and floors; occluders are transparent."""
    folder.mkdir(exist_ok=True)
    # coarse panoramas change visibility, not the facades
    facades = make_plan(replace(block, settings=replace_settings(block.settings, panorama_width=256))).facades
    fronts = np.flatnonzero(facades.role == WallRole.STREET).tolist()
    chosen = [i for i in fronts if PHOTO_METRES[0] <= facades.width[i] <= PHOTO_METRES[1]][::PHOTO_EVERY]

    def paint(number: int) -> None:
        i = chosen[number]
        width, height, floors = float(facades.width[i]), float(facades.height[i]), int(facades.floors[i])
        painted = paint_facade(
            (height, width),
            floors=floors,
            columns=max(1, round(width / 3.4)),
            style=NORDIC_STYLES[number % len(NORDIC_STYLES)],
            metres_per_pixel=1 / PHOTO_PIXELS_PER_METRE,
            seed=SEED + i,
            occluders=2,
        )
        alpha = np.where(painted.occluded, 0, 255).astype(np.uint8)
        _save(folder / f"{facades.id[i]}.webp", np.dstack([painted.image, alpha]))

    with ThreadPoolExecutor(2) as threads:
        list(threads.map(paint, range(len(chosen))))


def _save(path: Path, pixels: UInt8Array) -> None:
    Image.fromarray(pixels).save(path, quality=QUALITY, method=6)


def main() -> None:
    """Paint the style library and the photos of the demo's block into the package."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copy_map(folder)
        paint_exemplars(folder / "exemplars")
        write_block_file(folder / "without-photos.yaml", folder / "exemplars", photos=False)
        paint_photos(read_block(folder / "without-photos.yaml"), folder / "photos")
        for kind in ("exemplars", "photos"):
            shutil.rmtree(PAINTED_PICTURES / kind, ignore_errors=True)
            shutil.copytree(folder / kind, PAINTED_PICTURES / kind)


if __name__ == "__main__":
    main()
