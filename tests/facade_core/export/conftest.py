"""Two houses on a street with every chart of the atlas in a colour of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely

from benchmarks.clients import validators
from benchmarks.programs import MissingProgramError, node, package
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, Street
from facade_core.export.models.textured_mesh import TexturedMesh, build_textured_mesh
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene

STREET = Street("s", None, shapely.LineString([(386000, 6671980), (386050, 6671980)]))


def colour_of(chart: int) -> np.ndarray:
    return np.array([20 + 5 * (chart % 45), 40 + 40 * (chart // 45), 255 - 5 * (chart % 45)], np.uint8)


@pytest.fixture(scope="session")
def houses() -> Scene:
    x, y = 386000, 6671990
    buildings = [
        Building("a", shapely.box(x, y, x + 20, y + 10), 12.0, "height"),
        Building("b", shapely.box(x + 20, y, x + 32, y + 10), 9.0, "height"),
    ]
    charts, mesh, _ = build_block_surfaces(
        buildings, [STREET], terrain=build_terrain([], None), ground_margin=10, largest=90
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024))


@pytest.fixture(scope="session")
def coloured(houses: Scene) -> TexturedMesh:
    def page(number: int) -> np.ndarray:
        drawn = np.zeros((1024, 1024, 3), np.uint8)
        place = houses.placement
        for c in np.flatnonzero(place.page == number).tolist():
            drawn[place.y[c] : place.y[c] + place.height[c], place.x[c] : place.x[c] + place.width[c]] = colour_of(c)
        return drawn

    return build_textured_mesh(houses, page)


@pytest.fixture(scope="session")
def gltf_issues() -> Callable[..., list[dict[str, Any]]]:
    """What Khronos' validator says of GLB files; skips where it is absent."""
    try:
        package("gltf-validator")
        node()
    except MissingProgramError as absent:
        pytest.skip(str(absent))
    return validators.gltf_issues
