"""Small runs of every numba kernel of a run with default settings, which fill numba's cache before units run.

Compilation takes a minute on a new machine. Without the warm-up, all workers would compile everything at the same time.
Kernels of streets are left to the first street that sees pictured ground.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from shapely.geometry import LineString, box

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Building, Element, IngestSettings, Street, Sun
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import render_perspective
from facade_core.facade.exemplar_facade import ScaledStyle, build_facade_from_exemplar
from facade_core.facade.layout.completion import complete
from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.texture.retargeting import analyse_exemplar
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.geometry.charts import ChartKind
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.street.lighting.facade_light import light_facade
from facade_core.street.lighting.light import SceneLight
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart

DENSITY = 10.0
SIZE_M = (7.0, 9.0)


def compile_layout_kernels() -> None:
    """Complete a layout whose lower half is hidden."""
    seen = [Element("window", x, 1.0, x + 1.0, 2.5) for x in (1.0, 3.0, 5.0)]
    complete(seen, (0.0, 0.0, 7.0, 8.0), [(0.0, 0.0, 7.0, 4.0)])


def draw_facade() -> tuple[UInt8Array, UInt8Array, list[Element]]:
    """Draw a wall with two floors of three windows: its pixels, class ids, and windows in pixels."""
    height, width = (round(side * DENSITY) for side in SIZE_M)
    image = np.random.default_rng(0).integers(120, 180, (height, width, 3), np.uint8)
    labels = np.full((height, width), FacadeClass.WALL, np.uint8)
    windows = [Element("window", x, y, x + 10, y + 15) for y in (10, 40) for x in (15, 40, 65)]
    for window in windows:
        pixels = slice(int(window.y0), int(window.y1)), slice(int(window.x0), int(window.x1))
        image[pixels] //= 3 if window.y0 < height / 3 else 2  # two types of windows
        labels[pixels] = FacadeClass.WINDOW
    return image, labels, windows


def compile_texture_kernels() -> None:
    """Retarget and inpaint an exemplar."""
    image, labels, elements = draw_facade()
    height, width = labels.shape
    wall = FacadeWall.freestanding(SIZE_M[0], SIZE_M[1] + 3, floors=2)
    raster = (height, round(wall.width * DENSITY))
    style = ScaledStyle(analyse_exemplar(image, labels), 1 / DENSITY)
    build_facade_from_exemplar(style, wall, raster)
    hidden = np.zeros((height, width), bool)
    hidden[height // 2 :, : width // 3] = True
    inpaint(image, hidden, labels=labels, elements=elements)


def compile_street_kernels() -> None:
    """Finish the surfaces of a street, and render a picture of them."""
    plan = build_plan(
        BlockInputs(
            [Building("a", box(0, 0, 12, 10), 9.0, "height")],
            [Street("s", "s", LineString([(0, -6), (12, -6)]))],
            floor_height=3.0,
        ),
        IngestSettings(
            texels_per_metre=DENSITY,
            viewpoint_spacing=6.0,
            viewpoint_height=2.5,
            visibility_range=20.0,
            panorama_width=64,
            walls="translate",
        ),
    )
    scene, placement = plan.scene, plan.scene.placement
    materials = MaterialField(scene, plan.streets, seed=0, ground=plan.ground)

    def read(chart: int, rows: slice, columns: slice) -> tuple[UInt8Array, UInt8Array]:
        size = placement.shape(chart)
        return np.zeros((*size, 3), np.uint8)[rows, columns], np.zeros(size, np.uint8)[rows, columns]

    for chart in range(len(scene.charts)):
        finish_chart(scene, materials, chart, KnownTexture(read, ()))
    chart, sun = int(np.flatnonzero(scene.charts.kind == ChartKind.WALL)[0]), Sun(180.0, 45.0)
    shape = placement.shape(chart)
    wall = np.full((*shape, 3), 128, np.uint8), np.ones(shape, bool), np.full(shape, FacadeClass.WALL, np.uint8)
    light_facade(scene, SceneLight(scene, materials.reflectance, sun), chart, *wall, 0)
    camera = PerspectiveCamera.from_heading(
        plan.viewpoints[0].position, heading=0, pitch=5, field_of_view=60, size=(6, 8)
    )
    render_perspective(scene, camera, materials.chart_raster)


# The longest first.
WARMUPS: tuple[Callable[[], None], ...] = (compile_street_kernels, compile_layout_kernels, compile_texture_kernels)
