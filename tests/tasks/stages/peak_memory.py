"""Print the peak memory of units beyond what the process held before: `python peak_memory.py JOBS`.

A small unit of the stage loads and compiles the libraries first, since a worker has them once.
"""

import ctypes
import gc
import json
import sys

import numpy as np

from tasks.engine.compute.worker_setup import limit_threads

limit_threads()


def status(name):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith(name))


def picture(height, width):
    import cv2

    from benchmarks.painter.exemplars import paint_exemplar_set

    image = cv2.resize(paint_exemplar_set(1, seed=5)[0].image, (width, height))
    hidden = np.zeros((height, width), bool)
    hidden[height // 2 :, width // 3 : width // 2] = True
    return image, hidden


FACADES = {}


def photo(height, width):
    from facade_core.facade.evidence import Evidence
    from facade_core.facade.photo_facade import build_facade_from_photo

    image, hidden = picture(height, width)

    def unit():
        FACADES[height, width] = build_facade_from_photo(Evidence(image=image, hidden=hidden))

    return unit


def exemplar(height, width):
    from facade_core.facade.exemplar import prepare_exemplar

    image, hidden = picture(height, width)
    return lambda: prepare_exemplar(image, hidden, floor_height=3.2)


def retargeted(height, width):
    from benchmarks.painter.exemplars import paint_exemplar_set
    from facade_core.facade.exemplar_facade import ScaledStyle, build_facade_from_exemplar
    from facade_core.facade.texture.retargeting import analyse_exemplar
    from facade_core.facade.texture.wall_floors import FacadeWall

    made = paint_exemplar_set(1, seed=5)[0]
    wall = FacadeWall.freestanding(height / 20, width / 20, floors=max(1, round(height / 20 / 3.2)))
    style = ScaledStyle(analyse_exemplar(made.image, made.labels), 0.05)
    return lambda: build_facade_from_exemplar(style, wall, (height, width))


def street(height, width):
    import shapely

    from facade_core.core.atlas_spec import AtlasSpec
    from facade_core.core.types import Building, Street
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.chart_packing import pack_charts
    from facade_core.geometry.charts import ChartKind
    from facade_core.geometry.ground.terrain import build_terrain
    from facade_core.geometry.scene import Scene
    from facade_core.geometry.streets import Viewpoint
    from facade_core.street.continuation import continue_street
    from facade_core.street.materials.field import MaterialField

    line = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
    houses = [Building(str(i), shapely.box(22 * i, 0, 22 * i + 20, 10), 12.0, "height") for i in range(3)]
    charts, mesh, _ = build_block_surfaces(
        houses, [line], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    density = float(height)  # texels per metre
    placement = pack_charts(charts.size, density, charts.building, page=4096, chunk=256, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, density, page=4096))
    materials = MaterialField(scene, [line], seed=1)
    viewpoints = [Viewpoint(n, 0, np.array([5.0 * n, -8.0, 2.5]), np.array([1.0, 0.0])) for n in range(3)]
    scene.cast_panorama(viewpoints[0], width)
    ground = np.flatnonzero(charts.kind == ChartKind.GROUND)
    seen = [ground] * len(viewpoints)
    rasters = {chart: materials.chart_raster(chart) for chart in ground.tolist()}

    def unit():
        shown = {chart: (raster.copy(), np.ones(raster.shape[:2], bool)) for chart, raster in rasters.items()}
        continue_street(scene, materials, viewpoints, seen, shown)
        return int(np.prod(charts.size[ground], axis=1).sum())

    return unit


def surface(height, width):
    import shapely

    from facade_core.core.atlas_spec import AtlasSpec
    from facade_core.core.types import Building, Street
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.chart_packing import pack_charts
    from facade_core.geometry.ground.terrain import build_terrain
    from facade_core.geometry.scene import Scene
    from facade_core.street.materials.field import MaterialField
    from facade_core.street.surfaces import KnownTexture, finish_chart

    line = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
    houses = [Building("a", shapely.box(0, 0, 40, 10), 40.0, "height")]
    charts, mesh, _ = build_block_surfaces(
        houses, [line], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    density = float(height)  # texels per metre
    placement = pack_charts(charts.size, density, charts.building, page=4096, chunk=256, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, density, page=4096))
    field = MaterialField(scene, [line], seed=1)
    chart = int(np.argmax(charts.size.prod(axis=1)))
    shape = placement.shape(chart)
    rank = np.zeros(shape, np.uint8)
    rank[:30] = 5  # a strip is known, and all the rest is levelled to it
    known = np.zeros((*shape, 3), np.uint8)

    def read(one, rows, columns):
        return known[rows, columns], rank[rows, columns]

    def unit():
        finish_chart(scene, field, chart, KnownTexture(read, {chart}))
        return shape[0] * shape[1]

    return unit


def walls(height, width):
    import shapely

    from facade_core.core.atlas_spec import AtlasSpec
    from facade_core.core.types import Building
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.chart_packing import pack_charts
    from facade_core.geometry.ground.terrain import build_terrain
    from facade_core.geometry.scene import Scene

    houses = [Building(str(i), shapely.box(40 * i, 0, 40 * i + 39, 30), 30.0, "height") for i in range(width)]
    charts, mesh, _ = build_block_surfaces(houses, [], terrain=build_terrain([], None), ground_margin=5, largest=60)
    placement = pack_charts(charts.size, height, charts.building, page=2048, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, float(height)))


def page(height, width):
    import io

    from PIL import Image

    from facade_core.export.models.pages import fill_between_charts

    scene = walls(height, width)
    noise = np.random.default_rng(1).integers(0, 255, (2048, 2048, 3), np.uint8)

    def unit():
        Image.fromarray(fill_between_charts(scene, 0, noise)).save(io.BytesIO(), "JPEG", quality=95, subsampling=0)
        return noise.size // 3

    return unit


def tile(height, width):
    from facade_core.export.models.textured_mesh import build_textured_mesh
    from facade_core.export.tiles.tile_model import build_tile_model

    scene = walls(height, width)
    source = build_textured_mesh(scene, lambda page: None)
    charts = source.select_charts(np.arange(-1, width))

    def rasters(chosen):
        return {c: np.full((*source.texels[c][::-1], 3), 90, np.uint8) for c in chosen.tolist()}

    def unit():
        build_tile_model(source, charts, [""] * len(charts), {}, rasters, {"origin": [0.0, 0.0, 0.0]})
        return int(source.texels[charts].prod(axis=1).sum())

    return unit


def view(height, width):
    from facade_core.export.pictures.camera import aerial_camera
    from facade_core.export.pictures.rendering import cast_smooth_view, encode_image
    from facade_core.export.pictures.settings import BLOCK_VIEWS
    from facade_core.export.pictures.views import paint_view

    scene = walls(4, 2)
    page = np.zeros((2048, 2048, 3), np.uint8)
    camera = aerial_camera(scene, (height, width))

    def unit():
        picture = cast_smooth_view(scene, camera, samples=BLOCK_VIEWS.samples_per_pixel_side)
        assert len(picture.coarse.pixel) > picture.coarse.rgb.size // 9
        parts = ({c: np.copy(page)} for c in picture.visible_charts.tolist())
        encode_image(paint_view(picture, parts), "JPEG", quality=90)
        return height * width

    return unit


def drawn(height, width):
    from facade_core.export.pictures.occlusion_overlay import overlay_occlusion
    from facade_core.export.pictures.rendering import draw_parse, encode_image
    from facade_core.export.pictures.stage_pictures import REPORT_SAMPLE_SEEDS
    from facade_core.facade.evidence import Evidence
    from facade_core.facade.photo_facade import build_facade_from_photo
    from facade_core.facade.variation.level_drawing import draw_level
    from streetloom.variation import Hierarchy

    image, hidden = picture(height, width)
    made = FACADES.get((height, width)) or build_facade_from_photo(Evidence(image=image, hidden=hidden))
    stored = made.hierarchy.to_bytes()

    def unit():
        held = Hierarchy.from_bytes(stored)
        stages = [
            lambda: overlay_occlusion(made.evidence.copy(), made.occluded.copy()),
            lambda: draw_parse(made.labels.copy(), made.lattice),
            made.image.copy,
            *(lambda level=level: draw_level(held, level) for level in (0, len(held.levels) - 1)),
            *(lambda seed=seed: held.sample(len(held.levels) // 2, seed) for seed in REPORT_SAMPLE_SEEDS),
        ]
        for draw in stages:
            encode_image(draw(), "WEBP", quality=82, method=2)
        return height * width

    return unit


def measure(jobs):
    """List the peak bytes and the texels of every job (stage, size of the warm-up, size)."""
    measured, warm = [], set()
    for kind, small, size in jobs:
        unit = STAGES[kind]
        if kind not in warm:
            unit(*small)()
        warm.add(kind)
        work = unit(*size)
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)  # freed memory must not be reused
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")  # restarts the peak
        before = status("VmRSS")
        result = work()
        measured.append([status("VmHWM") - before, result if isinstance(result, int) else size[0] * size[1]])
        del work, result
    return measured


STAGES = {unit.__name__: unit for unit in (photo, exemplar, retargeted, street, surface, page, tile, view, drawn)}

if __name__ == "__main__":
    print(json.dumps(measure(json.loads(sys.argv[1]))))
