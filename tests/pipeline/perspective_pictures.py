"""Perspective pictures of house a of the small block, from the street and from the air."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from benchmarks.painter.facade import paint_facade
from facade_core.core.lens_projection import picture_rays
from facade_core.core.types import Lens, Pose
from facade_core.imagery.panorama_camera import camera_from_world
from tests.pipeline.stages import BUILDINGS, EAST, NORTH, STREETS, write_block

SIZE = (900, 600)
LENS = Lens(SIZE, (420.0, 420.0), (450.0, 300.0), (-0.05, 0.004))
WALL = paint_facade((12.0, 7.0), floors=2, columns=4, style="jugend", metres_per_pixel=0.04, seed=2).image
rng = np.random.default_rng(4)
# Ground from 20 m south and 20 m west of where streets begin, and the roof of house a: four pixels a metre.
PAVED = cv2.resize(rng.integers(60, 190, (60, 90), np.uint8), (360, 240), interpolation=cv2.INTER_CUBIC)
ROOF = cv2.resize(rng.integers(90, 230, (6, 24, 3), np.uint8), (96, 24), interpolation=cv2.INTER_CUBIC)
# By picture: metres east, north and up, heading, pitch, roll. Two of the street, two that look down from the south.
CAMERAS = {
    "street-1": (7.0, -8.0, 2.5, 10.0, 4.0, 0.5),
    "street-2": (13.0, -8.5, 2.5, -8.0, 3.0, -1.0),
    "air-1": (6.0, -22.0, 34.0, 6.0, -50.0, 0.0),
    "air-2": (15.0, -22.0, 36.0, -9.0, -50.0, 1.0),
}
# One of the sky.
NEEDLESS = {"sky": (10.0, -8.0, 2.5, 180.0, 75.0, 0.0)}


def _write_picture(path: Path, camera: tuple[float, ...]) -> None:
    """What a camera sees of house a with its flat roof, and of paved ground."""
    east, north, up, *angles = camera
    rays = picture_rays(LENS, SIZE[::-1]) @ camera_from_world(Pose(0, 0, 0, *angles))
    image = np.full((*SIZE[::-1], 3), (200, 215, 235), np.uint8)
    with np.errstate(divide="ignore", invalid="ignore"):
        for plane in ("ground", "roof", "wall"):  # nearer ones last, as seen from the south
            axis, at = {"ground": (2, -up), "roof": (2, 7.0 - up), "wall": (1, 5.0 - north)}[plane]
            distance = at / rays[..., axis]
            x, y, z = (start + distance * rays[..., i] for i, start in enumerate((east, north, up)))
            if plane == "ground":
                on, colours, column, row = distance > 0, PAVED[..., None].repeat(3, 2), (x + 20) * 4, (y + 30) * 4
                image[on] = 120
            elif plane == "roof":
                on, colours, column, row = (distance > 0) & (y > 5) & (y < 7.8), ROOF, (x - 4) * 8, (y - 5) * 8
            else:
                on, colours = (distance > 0) & (z > 0) & (z < 7), WALL
                column, row = (x - 4) / 12 * WALL.shape[1], (7 - z) / 7 * WALL.shape[0]
            rows, columns = colours.shape[:2]
            on &= (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            image[on] = colours[row[on].astype(int), column[on].astype(int)]
    Image.fromarray(image).save(path, quality=95)


def write_picture_block(folder: Path) -> Path:
    """Write the pictures, their poses and the block of house a."""
    (folder / "images").mkdir(parents=True)
    rows = ["file,x,y,z,heading,pitch,roll,focal_px,width,height,k1,k2"]
    for name, camera in (CAMERAS | NEEDLESS).items():
        _write_picture(folder / "images" / f"{name}.jpg", camera)
        east, north, up, heading, pitch, roll = camera
        rows.append(f"{name},{EAST + east},{NORTH + north},{up},{heading},{pitch},{roll},420,900,600,-0.05,0.004")
    (folder / "poses.csv").write_text("\n".join(rows))
    return write_block(
        folder,
        buildings={"a": BUILDINGS["a"]},
        streets={"1": STREETS["1"]},
        imagery={"cameras": {"path": "images", "poses": "poses.csv"}},
        texture={"texels_per_metre": 8, "walls": "translate"},
    )
