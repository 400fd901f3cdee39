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
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.facades.stage import facade_memory
from tasks.stages.pages.stage import page_memory
from tasks.stages.pictures.stage import facade_pictures_memory, view_memory
from tasks.stages.shared.memory import LIBRARY_BYTES, PICTURE_PIXEL
from tasks.stages.streets.memory import street_memory
from tasks.stages.surfaces.stage import surface_memory
from tasks.stages.textures.stage import TEXTURE_TEXEL, texture_memory
from tasks.stages.tiles.stage import tile_memory

# Peak of what a process holds while it does a unit, beside what it held before: libraries are loaded and compiled by a small
# unit first, since a worker has them once.
MEASURE = """
import json, os, sys
import numpy as np
from tasks.engine.compute.worker_setup import limit_threads
limit_threads()

def status(name):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith(name))

def picture(height, width):
    from facade_core.synth.exemplars import exemplars
    import cv2
    image = cv2.resize(exemplars(1, seed=5)[0].image, (width, height))
    hidden = np.zeros((height, width), bool)
    hidden[height // 2 :, width // 3 : width // 2] = True
    return image, hidden

FACADES = {}

def photo(height, width):
    from facade_core.facade.pipeline import build_facade_from_photo
    image, hidden = picture(height, width)
    def unit():
        FACADES[height, width] = build_facade_from_photo(image, hidden)
    return unit

def exemplar(height, width):
    from facade_core.facade.pipeline import prepare_exemplar
    image, hidden = picture(height, width)
    return lambda: prepare_exemplar(image, hidden, floor_height=3.2)

def retargeted(height, width):
    from facade_core.facade.pipeline import build_facade_from_exemplar
    from facade_core.synth.exemplars import exemplars
    from facade_core.facade.texture.retargeting import extract_style
    from facade_core.facade.texture.wall_floors import FacadeWall
    made = exemplars(1, seed=5)[0]
    wall = FacadeWall.freestanding(height / 20, width / 20, floors=max(1, round(height / 20 / 3.2)))
    return lambda: build_facade_from_exemplar(extract_style(made.image, made.labels), wall, (height, width),
    metres_per_pixel=0.05)

def street(height, width):
    import shapely
    from facade_core.core.atlas_spec import AtlasSpec
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.chart_packing import pack_charts
    from facade_core.geometry.ground.terrain import build_terrain
    from facade_core.geometry.scene import Scene
    from facade_core.geometry.streets import Viewpoint
    from facade_core.street.propagation.blend import blend_views
    from facade_core.street.propagation.propagate import propagate
    from facade_core.street.propagation.render import render
    from facade_core.street.propagation.texel_buffer import TexelBuffer
    from facade_core.street.translator.translators import MaterialFieldTranslator
    from facade_core.core.types import Building, Street
    line = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
    houses = [Building(str(i), shapely.box(22 * i, 0, 22 * i + 20, 10), 12.0, "height") for i in range(3)]
    charts, mesh, _ = build_block_surfaces(houses, [line], terrain=build_terrain([], None), ground_margin=20, largest=100)
    density = float(height)  # texels per metre
    placement = pack_charts(charts.size, density, charts.building, page=4096, chunk=256, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, density, page=4096))
    translator = MaterialFieldTranslator(scene, [line], seed=1)
    scene.cast_panorama(Viewpoint(0, 0, np.array([0.0, -8.0, 2.5]), np.array([1.0, 0.0])), width)
    chosen = range(len(charts))
    def unit():
        rasters, write = TexelBuffer.plan_layout(placement, chosen, chosen)
        seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
        window = TexelBuffer.allocate(placement, rasters, write, seed, evidence)
        for x in (0.0, 5.0, 10.0):
            viewpoint = Viewpoint(0, 0, np.array([x, -8.0, 2.5]), np.array([1.0, 0.0]))
            panorama = render(scene, window, viewpoint, (width // 2, width))
            propagate(scene, window, viewpoint, translator.translate(panorama), charts_seen=panorama.chart)
        result = blend_views(window.state)
        return rasters.total
    return unit

def surface(height, width):
    import shapely
    from facade_core.core.atlas_spec import AtlasSpec
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.chart_packing import pack_charts
    from facade_core.geometry.ground.terrain import build_terrain
    from facade_core.geometry.scene import Scene
    from facade_core.street.materials.field import MaterialField
    from facade_core.street.surfaces import KnownTexture, finish_chart
    from facade_core.core.types import Building, Street
    line = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
    houses = [Building("a", shapely.box(0, 0, 40, 10), 40.0, "height")]
    charts, mesh, _ = build_block_surfaces(houses, [line], terrain=build_terrain([], None), ground_margin=20, largest=100)
    density = float(height)  # texels per metre
    placement = pack_charts(charts.size, density, charts.building, page=4096, chunk=256, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, density, page=4096))
    field = MaterialField(scene, [line], seed=1)
    chart = int(np.argmax(charts.size.prod(axis=1)))
    shape = (int(placement.height[chart]), int(placement.width[chart]))
    rank = np.zeros(shape, np.uint8)
    rank[:30] = 5  # a strip is known, and all the rest is levelled to it
    known = np.zeros((*shape, 3), np.uint8)
    def read(one, rows, columns):
        return known[rows, columns], rank[rows, columns]
    def unit():
        result = finish_chart(scene, field, chart, KnownTexture(read, {chart}, ()), is_neural=True)
        return shape[0] * shape[1]
    return unit

def walls(height, width):
    from facade_core.core.atlas_spec import AtlasSpec
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.chart_packing import pack_charts
    from facade_core.geometry.ground.terrain import build_terrain
    from facade_core.geometry.scene import Scene
    from facade_core.core.types import Building
    import shapely
    houses = [Building(str(i), shapely.box(40 * i, 0, 40 * i + 39, 30), 30.0, "height") for i in range(width)]
    charts, mesh, _ = build_block_surfaces(houses, [], terrain=build_terrain([], None), ground_margin=5, largest=60)
    placement = pack_charts(charts.size, height, charts.building, page=2048, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, float(height)))

def page(height, width):
    import io
    from PIL import Image
    from facade_core.export.models.pages import between_charts
    scene = walls(height, width)
    noise = np.random.default_rng(1).integers(0, 255, (2048, 2048, 3), np.uint8)
    def unit():
        Image.fromarray(between_charts(scene, 0, noise)).save(io.BytesIO(), "JPEG", quality=95, subsampling=0)
        return noise.size // 3
    return unit

def tile(height, width):
    from facade_core.export.models.textured_mesh import textured_scene
    from facade_core.export.tiles.tile_model import tile_model
    scene = walls(height, width)
    source = textured_scene(scene, lambda page: None)
    charts = source.select_charts(np.arange(-1, width))
    def rasters(chosen):
        return {c: np.full((*source.texels[c][::-1], 3), 90, np.uint8) for c in chosen.tolist()}
    def unit():
        tile_model(source, charts, [""] * len(charts), {}, rasters, {"origin": [0.0, 0.0, 0.0]})
        return int(source.texels[charts].prod(axis=1).sum())
    return unit

def view(height, width):
    from facade_core.export import aerial, aim
    from facade_core.export.pictures.rendering import file_of
    from facade_core.export.pictures.views import SAMPLES, paint
    scene = walls(4, 2)
    page = np.zeros((2048, 2048, 3), np.uint8)
    camera = aerial(scene, (height, width))
    def unit():
        picture = aim(scene, camera, samples=SAMPLES)
        assert len(picture.pixel) > picture.rgb.size // 9
        parts = ({c: np.copy(page)} for c in picture.visible_charts.tolist())
        file_of(paint(picture, parts), "JPEG", quality=90)
        return height * width
    return unit

def drawn(height, width):
    from facade_core.export import draw_facade, overlay_hidden
    from facade_core.export.pictures.stage_pictures import SAMPLES
    from facade_core.export.pictures.rendering import file_of
    from facade_core.facade.pipeline import build_facade_from_photo
    from facade_core.variation import Hierarchy, draw_level
    made = FACADES.get((height, width)) or build_facade_from_photo(*picture(height, width))
    stored = made.hierarchy.to_bytes()
    def unit():
        held = Hierarchy.from_bytes(stored)
        stages = [
            lambda: overlay_hidden(made.evidence.copy(), made.occluded.copy()),
            lambda: draw_facade(made.labels.copy(), made.lattice),
            lambda: made.image.copy(),
            *(lambda level=level: draw_level(held, level) for level in (0, len(held.levels) - 1)),
            *(lambda seed=seed: held.sample(len(held.levels) // 2, seed) for seed in SAMPLES),
        ]
        for draw in stages:
            file_of(draw(), "WEBP", quality=82, method=2)
        return height * width
    return unit

def network(height, width):
    from facade_core.street.translator.neural_translator import load_translator
    translator, image = load_translator(), np.zeros((height, width, 3), np.uint8)
    def unit():
        translator.translate_image(image)
        return height * width
    return unit

import ctypes, gc
told, warm = [], set()
for kind, small, size in json.loads(sys.argv[1]):
    unit = globals()[kind]
    if kind not in warm:
        unit(*small)()
    warm.add(kind)
    work = unit(*size)
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)  # what was freed is not there to be used again
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")  # the peak starts anew
    before = status("VmRSS")
    made = work()
    told.append([status("VmHWM") - before, made if isinstance(made, int) else size[0] * size[1]])
    del work, made
print(json.dumps(told))
"""


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
        [sys.executable, "-c", MEASURE, json.dumps(jobs)], capture_output=True, text=True, check=True, timeout=300
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


@pytest.mark.parametrize("number", range(len(PHOTOS)))
def test_a_facade_from_a_photo_fits_what_it_declares(
    number: int, of_photos: list[tuple[int, int]], tmp_path: Path
) -> None:
    photo = tmp_path / "photo.png"
    Image.fromarray(np.zeros((*PHOTOS[number], 3), np.uint8)).save(photo)
    taken, texels = of_photos[number]
    assert_fits(facade_memory(texels, FacadeImagery(photo)), taken)


def test_a_facade_from_an_exemplar_fits_what_it_declares() -> None:
    taken, texels = measured("retargeted", (240, 320), (600, 1000))
    assert_fits(facade_memory(texels, FacadeImagery(exemplar=(0, "e"))), taken)


def test_an_exemplar_fits_what_it_declares(tmp_path: Path) -> None:
    picture = tmp_path / "exemplar.png"
    Image.fromarray(np.zeros((800, 1000, 3), np.uint8)).save(picture)
    taken, _ = measured("exemplar", (240, 320), (800, 1000))
    assert_fits(exemplar_memory(picture), taken)


def test_the_window_of_a_street_fits_what_it_declares() -> None:
    taken, texels = measured("street", (4, 256), (30, 512))
    assert_fits(street_memory(texels, texels), taken)


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


def test_a_surface_fits_what_it_declares() -> None:
    taken, texels = measured("surface", (4, 0), (40, 0))
    assert_fits(surface_memory(np.array([texels])), taken)


def test_a_panorama_fits_what_the_network_declares() -> None:
    taken, pixels = measured("network", (32, 64), (512, 1024))
    assert_fits(street_memory(0, 0, network=pixels), taken)


def test_a_broken_picture_takes_none(tmp_path: Path) -> None:
    (tmp_path / "broken.png").write_bytes(b"no picture")
    assert exemplar_memory(tmp_path / "broken.png") == LIBRARY_BYTES
    assert texture_memory(10, [tmp_path / "missing.png"]) == LIBRARY_BYTES + 10 * TEXTURE_TEXEL


def test_every_texel_and_pixel_counts(tmp_path: Path) -> None:
    picture = tmp_path / "picture.png"
    Image.fromarray(np.zeros((30, 20, 3), np.uint8)).save(picture)
    assert facade_memory(1000, FacadeImagery(picture)) - facade_memory(0, FacadeImagery(picture)) >= 100_000
    assert facade_memory(10, FacadeImagery(picture)) - facade_memory(10, FacadeImagery()) == 600 * PICTURE_PIXEL
    assert street_memory(200, 100) > street_memory(100, 100) < street_memory(100, 200)
