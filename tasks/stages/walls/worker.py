"""Worker of `walls`: write what panoramas show of a building's plain walls and roofs."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.types import Pose
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders, mask_model_edges
from facade_core.imagery.cameras.walls import fuse_wall_view
from tasks.engine.context import load_run_plan
from tasks.engine.inputs import (
    GEOMETRY_CHANGED,
    PANORAMAS_CHANGED,
    SURROUNDINGS_CHANGED,
    input_field,
)
from tasks.engine.run import Run
from tasks.stages.shared.panorama_cameras import PanoramaSurfaces, collect_chart_views, open_camera
from tasks.stages.shared.scene_view import SceneView
from tasks.stages.shared.surface_panorama import SurfacePanorama

# Panoramas of which the pixels beside edges of buildings are kept.
MAX_CACHED_EDGES = 8


@dataclass(frozen=True)
class WallInputs:
    """Inputs of the plain walls and roofs of a building.

    Attributes
    ----------
    panoramas : panoramas of each chart, in the order of the charts.
    between : what may stand between the charts and their panoramas.
    view : the charts.
    """

    panoramas: tuple[tuple[SurfacePanorama, ...], ...] = input_field(PANORAMAS_CHANGED)
    between: SceneView = input_field(SURROUNDINGS_CHANGED)
    view: SceneView = input_field(GEOMETRY_CHANGED)


def compute_walls(inputs: WallInputs) -> PanoramaSurfaces:
    """Fuse the walls and roofs of a building from panoramas."""
    start = time.time()
    refused: list[Exception] = []
    reading: list[float] = []

    def opened(one: SurfacePanorama) -> PanoramaCamera | None:
        begun = time.time()
        camera = open_camera(one, mask_building_occluders, refused)
        if camera is not None:
            edges = _edge_mask(inputs.between.run, one.pose, camera.occluded.shape)
            camera = replace(camera, occluded=camera.occluded | edges)
        reading.append(time.time() - begun)
        return camera

    taken: Mapping[int, Sequence[SurfacePanorama]] = dict(zip(inputs.view.charts, inputs.panoramas, strict=True))
    shown, used = collect_chart_views(taken, opened, partial(fuse_wall_view, inputs.between.scene))
    read = sum(reading)
    return PanoramaSurfaces(shown, used, refused, {"read": read, "walls": time.time() - start - read})


def _edge_mask(run: Run, pose: Pose, shape: tuple[int, ...]) -> BoolArray:
    """Return the pixels (H, W) of a panorama beside edges of buildings."""
    rows, columns = shape
    bits = _edge_bits(run, pose, rows, columns)
    return np.unpackbits(bits, count=rows * columns).reshape(rows, columns).astype(bool)


@lru_cache(maxsize=MAX_CACHED_EDGES)
def _edge_bits(run: Run, pose: Pose, rows: int, columns: int) -> UInt8Array:
    """Return the same as bits; consecutive units share them."""
    return np.packbits(mask_model_edges(load_run_plan(run).scene, pose, (rows, columns)))
