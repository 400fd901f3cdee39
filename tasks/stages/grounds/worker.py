"""Worker of `grounds`: write what panoramas show of a piece of ground."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import mask_ground_occluders
from tasks.engine.inputs import (
    GEOMETRY_CHANGED,
    PANORAMAS_CHANGED,
    SURROUNDINGS_CHANGED,
    input_field,
)
from tasks.stages.shared.panorama_cameras import PanoramaSurfaces, open_camera
from tasks.stages.shared.scene_view import SceneView
from tasks.stages.shared.surface_panorama import SurfacePanorama


@dataclass(frozen=True)
class GroundInputs:
    """Inputs of a piece of ground.

    Attributes
    ----------
    panoramas : panoramas that show it.
    between : what may stand between it and its panoramas.
    view : its chart.
    """

    panoramas: tuple[SurfacePanorama, ...] = input_field(PANORAMAS_CHANGED)
    between: SceneView = input_field(SURROUNDINGS_CHANGED)
    view: SceneView = input_field(GEOMETRY_CHANGED)


def compute_ground(inputs: GroundInputs) -> PanoramaSurfaces:
    """Fuse a piece of ground from panoramas."""
    start = time.time()
    refused: list[Exception] = []
    used: list[SurfacePanorama] = []
    reading: list[float] = []

    def cameras() -> Iterator[PanoramaCamera]:
        for one in inputs.panoramas:
            begun = time.time()
            camera = open_camera(one, mask_ground_occluders, refused)
            reading.append(time.time() - begun)
            if camera is not None:
                used.append(one)
                yield camera

    (chart,) = inputs.view.charts
    found = fuse_ground_view(inputs.between.scene, chart, cameras())
    read = sum(reading)
    shown = {} if found is None else {chart: found}
    return PanoramaSurfaces(shown, {chart: used}, refused, {"read": read, "ground": time.time() - start - read})
