"""Two houses on a street with every chart of the atlas in a colour of its own."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from facade_core.atlas import AtlasSpec
from facade_core.export.models import Textured, textured_scene
from facade_core.geometry import block_surfaces, pack, terrain_of
from facade_core.street import Scene
from facade_core.types import Building, Street

STREET = Street("s", None, shapely.LineString([(386000, 6671980), (386050, 6671980)]))
# What checks GLB files, from the npm registry.
VALIDATOR = "gltf-validator@2.0.0-dev.3.10"
CHECK = """
const {validateBytes} = require('gltf-validator'), fs = require('fs');
Promise.all(process.argv.slice(1).map(f => validateBytes(new Uint8Array(fs.readFileSync(f)))))
  .then(reports => console.log(JSON.stringify(reports.map(r => r.issues))));
"""


def colour_of(chart: int) -> np.ndarray:
    return np.array([20 + 5 * (chart % 45), 40 + 40 * (chart // 45), 255 - 5 * (chart % 45)], np.uint8)


@pytest.fixture(scope="session")
def houses() -> Scene:
    x, y = 386000, 6671990
    buildings = [
        Building("a", shapely.box(x, y, x + 20, y + 10), 12.0, "height"),
        Building("b", shapely.box(x + 20, y, x + 32, y + 10), 9.0, "height"),
    ]
    charts, mesh, _ = block_surfaces(buildings, [STREET], terrain=terrain_of([], None), ground_margin=10, largest=90)
    placement = pack(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024))


@pytest.fixture(scope="session")
def coloured(houses: Scene) -> Textured:
    def page(number: int) -> np.ndarray:
        drawn = np.zeros((1024, 1024, 3), np.uint8)
        place = houses.placement
        for c in np.flatnonzero(place.page == number).tolist():
            drawn[place.y[c] : place.y[c] + place.height[c], place.x[c] : place.x[c] + place.width[c]] = colour_of(c)
        return drawn

    return textured_scene(houses, page)


@pytest.fixture(scope="session")
def gltf_issues(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., list[dict[str, Any]]]:
    """What Khronos' validator says of GLB files; skips where npm cannot install it."""
    if not shutil.which("npm") or not shutil.which("node"):
        pytest.skip("no node and npm on this machine: GLB files are not validated")
    folder = tmp_path_factory.mktemp("validator")
    options = ["--no-audit", "--no-fund", "--no-package-lock"]
    done = subprocess.run(
        ["npm", "install", *options, VALIDATOR], cwd=folder, capture_output=True, text=True, timeout=300
    )
    if done.returncode:
        pytest.skip(f"npm cannot install {VALIDATOR}: {done.stderr.strip().splitlines()[-1:]}")

    def issues(*files: Path) -> list[dict[str, Any]]:
        paths = [str(file.resolve()) for file in files]
        found = subprocess.run(
            ["node", "-e", CHECK, *paths], cwd=folder, capture_output=True, text=True, timeout=300, check=True
        )
        return json.loads(found.stdout)

    return issues
