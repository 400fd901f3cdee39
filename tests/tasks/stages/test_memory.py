"""Declared memory against what units take: never less, and never so much more that workers stand idle."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from facade_core.export.models.pages import MAX_SHELF_PAGE_TEXELS
from facade_core.export.pictures.views import VIEW_SIZE
from tasks.stages.exemplars.stage import exemplar_memory
from tasks.stages.facades.imagery import ChosenExemplar, FacadeImagery
from tasks.stages.facades.stage import facade_memory
from tasks.stages.pages.stage import page_memory
from tasks.stages.pictures.stage import facade_pictures_memory, view_memory
from tasks.stages.shared.memory import LIBRARY_BYTES, PICTURE_PIXEL
from tasks.stages.streets.stage import street_memory
from tasks.stages.surfaces.stage import surface_memory
from tasks.stages.textures.stage import TEXTURE_TEXEL, texture_memory
from tasks.stages.tiles.stage import tile_memory

# Run as a process of its own for every measurement.
MEASURE = Path(__file__).with_name("peak_memory.py")


Job = tuple[str, tuple[int, int], tuple[int, int]]


def measured(kind: str, small: tuple[int, int], size: tuple[int, int]) -> tuple[int, int]:
    """Bytes and texels of a unit in a process of its own."""
    (found,) = measured_in_one((kind, small, size))
    return found


def measured_in_one(*jobs: Job) -> list[tuple[int, int]]:
    """Bytes and texels of units that one process does after each other."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        pytest.skip("this system does not let a process start its peak of memory anew")
    done = subprocess.run(
        [sys.executable, str(MEASURE), json.dumps(jobs)], capture_output=True, text=True, check=True, timeout=300
    )
    return [(taken, texels) for taken, texels in json.loads(done.stdout.splitlines()[-1])]


def assert_fits(declared: int, taken: int) -> None:
    assert taken <= declared, f"takes {taken / 1e6:.0f} MB of {declared / 1e6:.0f} declared"
    assert declared <= 6 * taken, f"takes {taken / 1e6:.0f} MB of {declared / 1e6:.0f} declared"


# The larger first: what it frees would be used again by another.
PHOTOS = [(1200, 1600), (640, 800)]


@pytest.fixture(scope="module")
def of_photos() -> list[tuple[int, int]]:
    """The facades of PHOTOS, and the pictures of the first."""
    jobs = [*(("photo", size) for size in PHOTOS), ("drawn", PHOTOS[0])]
    return measured_in_one(*((kind, (240, 320), size) for kind, size in jobs))


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(PHOTOS)))
def test_a_facade_from_a_photo_fits_what_it_declares(
    number: int, of_photos: list[tuple[int, int]], tmp_path: Path
) -> None:
    photo = tmp_path / "photo.png"
    Image.fromarray(np.zeros((*PHOTOS[number], 3), np.uint8)).save(photo)
    taken, texels = of_photos[number]
    assert_fits(facade_memory(texels, FacadeImagery(photo=photo)), taken)


@pytest.mark.long
def test_a_facade_from_an_exemplar_fits_what_it_declares() -> None:
    taken, texels = measured("retargeted", (240, 320), (600, 1000))
    assert_fits(facade_memory(texels, FacadeImagery(exemplar=ChosenExemplar(0, "e"))), taken)


@pytest.mark.long
def test_an_exemplar_fits_what_it_declares(tmp_path: Path) -> None:
    picture = tmp_path / "exemplar.png"
    Image.fromarray(np.zeros((800, 1000, 3), np.uint8)).save(picture)
    taken, _ = measured("exemplar", (240, 320), (800, 1000))
    assert_fits(exemplar_memory(picture), taken)


@pytest.mark.long
def test_the_window_of_a_street_fits_what_it_declares() -> None:
    taken, area = measured("street", (4, 256), (30, 1024))
    assert_fits(street_memory(area, np.full(3, area * 30**2 // 3)), taken)


def test_a_page_fits_what_it_declares() -> None:
    taken, texels = measured("page", (4, 1), (30, 2))
    assert_fits(page_memory(texels), taken)


def test_a_tile_of_several_pictures_fits_what_it_declares() -> None:
    taken, texels = measured("tile", (4, 1), (30, 12))
    assert texels > 1.5 * MAX_SHELF_PAGE_TEXELS**2
    assert_fits(tile_memory(texels), taken)


def test_a_view_fits_what_it_declares() -> None:
    taken, _ = measured("view", (90, 144), VIEW_SIZE)
    assert_fits(view_memory(2048**2), taken)


def test_pictures_of_a_facade_fit_what_they_declare(of_photos: list[tuple[int, int]]) -> None:
    taken, texels = of_photos[-1]
    assert_fits(facade_pictures_memory(texels), taken)


@pytest.mark.long
def test_a_surface_fits_what_it_declares() -> None:
    taken, texels = measured("surface", (4, 0), (40, 0))
    assert_fits(surface_memory(np.array([texels])), taken)


def test_a_broken_picture_takes_none(tmp_path: Path) -> None:
    (tmp_path / "broken.png").write_bytes(b"no picture")
    assert exemplar_memory(tmp_path / "broken.png") == LIBRARY_BYTES
    assert texture_memory(10, [tmp_path / "missing.png"]) == LIBRARY_BYTES + 10 * TEXTURE_TEXEL


def test_every_texel_and_pixel_counts(tmp_path: Path) -> None:
    picture = tmp_path / "picture.png"
    Image.fromarray(np.zeros((30, 20, 3), np.uint8)).save(picture)
    assert facade_memory(1000, FacadeImagery(photo=picture)) - facade_memory(0, FacadeImagery(photo=picture)) >= 100_000
    assert facade_memory(10, FacadeImagery(photo=picture)) - facade_memory(10, FacadeImagery()) == 600 * PICTURE_PIXEL
    assert street_memory(200) > street_memory(100)
