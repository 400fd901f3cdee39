"""What a camera sees of house a of the small block and of paved ground, as an equirectangular picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from benchmarks.painter.facade import paint_facade
from tests.pipeline.stages import BUILDINGS, EAST, NORTH, STREETS, write_block

WIDTH = 1536
HEIGHT_M = 2.5
FAR = 600.0  # houses c and d stand this far north of a and b
# Panoramas before houses a and c: streets 1 and 2 show ground of the first, street 3 that of the second.
CAMERAS = {"a-1": (8.0, -1.0, HEIGHT_M), "c-1": (9.0, FAR - 1, HEIGHT_M)}
# Keys of a block of panoramas whose other walls have their material alone.
PICTURED: dict[str, Any] = {
    "imagery": {"panoramas": {"path": "panoramas", "poses": "poses.json"}},
    "texture": {"walls": "translate"},
}
WALL = paint_facade((12.0, 7.0), floors=2, columns=4, style="jugend", metres_per_pixel=0.04, seed=2).image
# The ground from 10 m south and 10 m west of where streets begin, four pixels a metre.
PAVED = cv2.resize(np.random.default_rng(4).integers(60, 190, (44, 84), np.uint8), (168, 88)).astype(np.uint8)


def paint_panorama(east: float, north: float) -> np.ndarray:
    """Paint the picture from a place in metres from the streets' beginning; it looks north."""
    longitude = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * 2 * np.pi
    latitude = ((0.5 - (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2)) * np.pi)[:, None]
    ahead, right, up = np.cos(longitude) * np.cos(latitude), np.sin(longitude) * np.cos(latitude), np.sin(latitude)
    image = np.full((WIDTH // 2, WIDTH, 3), (200, 215, 235), np.uint8)
    with np.errstate(divide="ignore"):
        down = HEIGHT_M / np.where(up < 0, -up, np.nan) * np.ones_like(ahead)
        wall = (5.0 - north) / np.where(ahead > 1e-6, ahead, np.nan)
    column, row = ((at + 10) * 4 for at in (east + down * right, north + down * ahead))
    paved = (down > 0) & (column >= 0) & (column < 168) & (row >= 0) & (row < 88)
    image[up[:, 0] < 0] = 120
    image[paved] = PAVED[row[paved].astype(int), column[paved].astype(int), None]
    x, z = east + wall * right - 4.0, HEIGHT_M + wall * up
    on = (wall > 0) & (x >= 0) & (x < 12) & (z >= 0) & (z < 7)
    rows, columns = WALL.shape[:2]
    image[on] = WALL[((7 - z[on]) / 7 * rows).astype(int), (x[on] / 12 * columns).astype(int)]
    return image


def write_panoramas(folder: Path, cameras: Mapping[str, tuple[float, float, float]]) -> None:
    """Write panoramas by name, from metres east and north and the height that is stated."""
    (folder / "panoramas").mkdir(parents=True, exist_ok=True)
    poses = {}
    for name, (east, north, stated) in cameras.items():
        image = paint_panorama(east, north - FAR * round(north / FAR))
        Image.fromarray(image).save(folder / "panoramas" / f"{name}.jpg", quality=95)
        poses[f"{name}.jpg"] = {"x": EAST + east, "y": NORTH + north, "z": stated, "heading": 0}
    (folder / "poses.json").write_text(json.dumps({"crs": "EPSG:32635", "poses": poses}))


def write_panorama_block(folder: Path) -> Path:
    """Write the block of houses a and c whose walls and ground panoramas show."""
    return write_block(
        folder,
        buildings={name: BUILDINGS[name] for name in ("a", "c")},
        streets={name: STREETS[name] for name in ("1", "3")},
        imagery={"panoramas": {"path": "panoramas", "poses": "poses.json"}},
        texture={"texels_per_metre": 4, "walls": "translate"},
    )
