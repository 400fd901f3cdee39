"""A town of four small blocks, to rehearse with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar_set
from catalogs.block.yaml_files import format_yaml

EAST, NORTH = 385_000.0, 6_671_000.0
# Each block has one house at the street that passes all of them; a block is a square of so many metres.
SIDE_M = 70


def write_town(folder: Path, blocks: int) -> Path:
    """Write a city of some blocks in a row into a folder; returns its file."""
    folder.mkdir(parents=True)
    houses = [_house(f"h{number}", 4 + SIDE_M * number, 7.0 + number % 3) for number in range(blocks)]
    line = [[EAST + x, NORTH] for x in range(0, SIDE_M * blocks + 1, 35)]
    street = _feature("LineString", line, id="s", name="Long Street")
    for name, features in (("buildings", houses), ("streets", [street])):
        (folder / f"{name}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    (folder / "exemplars").mkdir()
    for number, painted in enumerate(paint_exemplar_set(2, seed=5, metres_per_pixel=0.2)):
        Image.fromarray(painted.image).save(folder / "exemplars" / f"{number}.png")
    keys = {
        "name": "town",
        "crs": "EPSG:32635",
        "buildings": {"path": "buildings.geojson", "crs": "EPSG:32635"},
        "streets": {"path": "streets.geojson", "crs": "EPSG:32635"},
        "imagery": {"exemplars": {"path": "exemplars"}},
        "texture": {"texels_per_metre": 4, "visibility_range": 25.0, "viewpoint_spacing": 9.0, "panorama_width": 128},
        "seed": 3,
        "cut": {"metres": SIDE_M},
    }
    (folder / "town.yaml").write_text(format_yaml(keys))
    return folder / "town.yaml"


def _house(name: str, west: float, height: float) -> dict[str, Any]:
    ring = [(west, 5), (west + 12, 5), (west + 12, 11), (west, 11), (west, 5)]
    places = [[EAST + x, NORTH + y] for x, y in ring]
    return _feature("Polygon", [places], id=name, height=height, **{"roof:shape": "flat"})


def _feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}
