"""What a texel of each material costs and how much of it is true: against plain functions of points, and means of these.

python -m benchmarks.materials [--pictures FOLDER] [--data DIR]

nanoseconds: of a whole chart at 20 texels a metre on one core, compiled, the least of some repetitions by the thread's clock;
plain: the same without footprints and light, in numpy. light: what its rays take, a texel.

aliasing: for texels at 8, 16, 32 a metre, what they differ from the means of 12 x 12 points each, as a share of the means'
variance: energy above what texels can show, come down into it. detail: their gradients' energy over that of these means. Both
beside those of one point a texel. With --data, which holds materials/: grain beside the photographs that it is from, alone.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks.materials import plain
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import BuildingFinish, Street
from facade_core.geometry.chart_packing import ChartPlacements, pack_charts
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.tiled_material import TiledMaterial
from facade_core.street.propagation.render import daylight_grey

DENSITY, DENSITIES, SEED = 20.0, (8.0, 16.0, 32.0), 7
REPEATED = 7
# Metres along a chart's sides, and from one to the next: none takes another's light.
SIDE_M, APART_M = 24.0, 192.0
# Those that are compared with means, of so many points along either side of a texel.
TRUTH_M, SAMPLES = 6.0, 12
# What a point covers, metres.
POINT_M = 1e-3
# The charts: their kind, how they lie, the material's plain function, and how far the ground is from a centreline, metres.
CHARTS: dict[str, tuple[int, str, str, float]] = {
    "carriageway": (ChartKind.GROUND, "level", "asphalt", 0.0),
    "paving": (ChartKind.GROUND, "level", "paving", 60.0),
    "kerb": (ChartKind.GROUND, "level", "ground", 4.0),
    "sheet metal": (ChartKind.ROOF, "level", "roofing", 0.0),
    "tiles": (ChartKind.ROOF, "tilted", "tiling", 0.0),
    "plaster": (ChartKind.WALL, "upright", "plaster", 0.0),
    "pane": (ChartKind.WINDOW, "upright", "glass", 0.0),
    "boards": (ChartKind.DOOR, "upright", "wood", 0.0),
    "soffit": (ChartKind.CEILING, "under", "soffit", 0.0),
}
AXES = {
    "level": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
    "tilted": ((1.0, 0.0, 0.0), (0.0, -0.8, -0.6)),
    "upright": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "under": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}


def scene_of(density: float, size: float = SIDE_M) -> tuple[Scene, list[Street]]:
    """A chart of each kind far from the others, and centrelines where the ground has them."""
    count = len(CHARTS)
    names = list(CHARTS.values())
    kind = np.array([row[0] for row in names], np.uint8)
    axis_u, axis_v = (np.array([AXES[row[1]][k] for row in names]) for k in (0, 1))
    origin = np.column_stack([APART_M * np.arange(count), np.zeros(count), np.full(count, size)])
    charts = Charts(
        kind, np.arange(count, dtype=np.int32), np.arange(count, dtype=np.int32), origin, axis_u, axis_v,
        np.full((count, 2), size),
    )  # fmt: skip
    corners = charts.points_at_shares(np.arange(count), np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])).reshape(-1, 3)
    own = np.arange(count, dtype=np.int32)
    halves = np.array([[0, 3, 2], [0, 2, 1]], np.int32)
    triangles = (4 * own[None, :, None] + halves[:, None]).reshape(-1, 3)
    mesh = Mesh(corners, triangles, np.tile(own, 2), np.repeat(own, 4))
    placement: ChartPlacements = pack_charts(charts.size, density, own, page=2048, chunk=128, gutter=2)
    streets = []
    for row, (_, _, name, aside) in enumerate(names):
        if kind[row] == ChartKind.GROUND and name != "paving":
            y = -size / 2 - (aside if name == "ground" else 0.0)
            line = shapely.LineString([(origin[row, 0] - 10, y - 3), (origin[row, 0] + size + 10, y + 4)])
            streets.append(Street(name, None, line))
    finishes = tuple(
        BuildingFinish(roof_material="metal") if name == "sheet metal" else BuildingFinish() for name in CHARTS
    )
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, density), finishes=finishes), streets


def measure(pictures: Path | None) -> dict[str, Any]:
    scene, streets = scene_of(DENSITY)
    materials = MaterialField(scene, streets, seed=SEED)
    rows: dict[str, dict[str, Any]] = {name: {} for name in CHARTS}
    for chart, (name, row) in enumerate(rows.items()):
        texels = int(scene.placement.width[chart] * scene.placement.height[chart])
        whole = materials.chart_raster(chart)
        row["nanoseconds"] = round(1e9 * _seconds(partial(materials.chart_raster, chart)) / texels, 1)
        stepped = _Plain(scene, streets, chart)
        row["nanoseconds_plain"] = round(1e9 * _seconds(stepped.raster) / texels, 1)
        if pictures is not None:
            _save(pictures / f"{name.replace(' ', '-')}.png", whole, stepped.raster())
    laid = MaterialField(scene, streets, seed=SEED, roof_material=_brick())
    chart = list(CHARTS).index("tiles")
    laid.chart_raster(chart)
    seconds = _seconds(partial(laid.chart_raster, chart))
    rows["a roof's own material"] = {"nanoseconds": round(1e9 * seconds / (SIDE_M * DENSITY) ** 2, 1)}
    for density in DENSITIES:
        scene, streets = scene_of(density, TRUTH_M)
        materials = MaterialField(scene, streets, seed=SEED)
        for chart, name in enumerate(CHARTS):
            rows[name][f"at {density:g} a metre"] = _truth(materials.chart_raster(chart), _Plain(scene, streets, chart))
    return {"materials": rows, "light_nanoseconds": _light(DENSITY)}


class _Plain:
    """A chart of the scene by the plain functions of its points: as bytes, or meant over several of a texel."""

    def __init__(self, scene: Scene, streets: list[Street], chart: int) -> None:
        self._scene, self._chart = scene, chart
        self._name = list(CHARTS.values())[chart][2]
        charts = scene.charts
        self._materials = MaterialField(scene, streets, seed=SEED)
        self._tint = _tint(self._materials, chart, self._name)
        self._grey = float(daylight_grey(charts.normals()[chart]))

    def raster(self) -> np.ndarray:
        """The chart (h, w, 3) by the plain functions, without grain, 0..255."""
        return self._means(1, self._colour)

    def of_points(self, samples: int) -> np.ndarray:
        """The chart (h, w, 3), each texel the mean of samples x samples points of the field itself, 0..255."""
        return self._means(samples, self._point)

    def _means(self, samples: int, colour: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
        placement, density = self._scene.placement, self._scene.spec.texels_per_metre
        height, width = int(placement.height[self._chart]), int(placement.width[self._chart])
        step = 1 / density
        offset = (np.arange(samples) + 0.5) / samples
        total = np.zeros((height * width, 3))
        for down in offset:
            for right in offset:
                x, y = np.meshgrid(step * (np.arange(width) + right), step * (np.arange(height) + down))
                total += colour(x.ravel(), y.ravel())
        return np.clip(total / samples**2, 0, 255).reshape(height, width, 3)

    def _point(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        points = self._scene.charts.points(self._chart, x, y)
        return self._materials.colour(np.full(len(x), self._chart), points, np.full(len(x), POINT_M)).astype(np.float64)

    def _colour(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        charts = self._scene.charts
        points = charts.points(self._chart, x, y)
        across, down = (points @ axis[self._chart] for axis in (charts.axis_u, charts.axis_v))
        other = np.zeros(len(x))
        if self._name in ("asphalt", "paving", "ground"):
            own = np.full(len(x), self._chart)  # of the ground the field itself, at a point
            return self._materials.colour(own, points, np.full(len(x), POINT_M)).astype(np.float64)
        if self._name == "roofing":
            across, down = points[:, 0], points[:, 1]
        elif self._name == "plaster":
            other = points[:, 2]
        elif self._name == "glass":
            across, down, other = x, y, np.full(len(x), charts.size[self._chart, 1])
        elif self._name == "wood":
            across, down = x, y
        low, high = self._tint
        return self._grey * (low + plain.MATERIALS[self._name](across, down, other, SEED)[:, None] * (high - low))


def _tint(materials: MaterialField, chart: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The colours of tones of 0 and 1."""
    from facade_core.street.materials.procedural import GLASS_COLOUR, REFLECTED_SKY_COLOUR

    surfaces = materials.arrays.charts
    return (
        (GLASS_COLOUR, REFLECTED_SKY_COLOUR)
        if name == "glass"
        else (np.zeros(3), surfaces.tint[chart] / surfaces.grey[chart])
    )


def _truth(raster: np.ndarray, stepped: _Plain) -> dict[str, float]:
    """Aliasing and detail of a raster and of points stepped through, by the means of points."""
    truth, points = np.round(stepped.of_points(SAMPLES)), np.round(stepped.of_points(1))
    found = {}
    for name, image in (("", raster.astype(np.float64)), ("_stepped", points)):
        wrong = np.mean((image - truth) ** 2) / np.mean((truth - truth.mean(axis=(0, 1))) ** 2)
        found[f"aliasing{name}"] = round(float(wrong), 4)
        found[f"detail{name}"] = round(_gradients(image) / _gradients(truth), 3)
    return found


def _gradients(image: np.ndarray) -> float:
    """The mean square of differences between texels side by side."""
    return float(np.mean(np.diff(image, axis=0) ** 2) + np.mean(np.diff(image, axis=1) ** 2))


def _light(density: float) -> dict[str, float]:
    """Of rays from charts side by side and all at once, a texel."""
    found = {}
    for name, together in (("one after the other", False), ("together", True)):
        scene, _ = scene_of(density)
        scene.daylight.compute([0])
        charts = np.arange(1, len(scene.charts))
        start = time.thread_time()
        for part in [charts] if together else np.split(charts, len(charts)):
            scene.daylight.compute(part)
        found[name] = round(1e9 * (time.thread_time() - start) / (len(charts) * (SIDE_M * density) ** 2), 2)
    return found


def _seconds(function: Callable[[], Any]) -> float:
    taken = []
    for _ in range(REPEATED):
        start = time.thread_time()
        function()
        taken.append(time.thread_time() - start)
    return min(taken)


def _brick() -> TiledMaterial:
    """A picture of some grain."""
    image = np.random.default_rng(0).integers(80, 160, (256, 256, 3), dtype=np.uint8)
    return TiledMaterial.from_picture(image, 0.02, DENSITY)


def _save(path: Path, *rasters: np.ndarray) -> None:
    """The first 12 m of rasters side by side, the kernel's and the plain one, three times as large."""
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    part = np.concatenate([raster[:160, :240].astype(np.uint8) for raster in rasters], axis=1)
    Image.fromarray(part.repeat(3, axis=0).repeat(3, axis=1)).save(path)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.materials", description=__doc__)
    parser.add_argument(
        "--pictures", type=Path, help="a folder for pictures of each material beside its plain function"
    )
    parser.add_argument("--data", type=Path, help="a data folder: grain beside its photographs instead")
    given = parser.parse_args()
    if given.data is not None:
        from benchmarks.materials.photographs import against_photographs

        print(json.dumps(against_photographs(given.data), indent=2))
        return
    print(json.dumps(measure(given.pictures), indent=2))
