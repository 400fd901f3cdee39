"""Pictures: the textured block as a camera sees it, and a facade's stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from typing import Any

import numpy as np

from facade_core.export.camera import Camera
from facade_core.geometry.raycast import MISS
from facade_core.grouping import Grouped
from facade_core.labels import CLASSES, COLOURS, colourise
from facade_core.street.scene import Scene
from facade_core.types import Lattice

# An element of which more than this share was hidden is one that the completion made.
COMPLETED = 0.3
# Layouts are drawn at least so many pixels high: lines over small facades stay thin.
LAYOUT_HEIGHT = 480
SKY_HIGH, SKY_LOW = np.array([126, 168, 214]), np.array([226, 234, 240])


@dataclass(frozen=True)
class Picture:
    """A picture under way: rgb (h, w, 3) uint8 with the sky drawn; pixels of the block wait for the rasters of their charts.

    pixel (k,) flat index; chart (k,); row, column (k,) the texel that each shows on its chart.
    """

    rgb: np.ndarray
    pixel: np.ndarray
    chart: np.ndarray
    row: np.ndarray
    column: np.ndarray

    @cached_property
    def seen(self) -> np.ndarray:
        """The charts (c,) that it shows, ascending."""
        return np.unique(self.chart)

    def paint(self, texels: np.ndarray, rasters: Mapping[int, np.ndarray]) -> None:
        """Draw, in place, the pixels that show some charts, by their rasters (h, w, 3), which may be coarser than the atlas:
        texels (charts, 2), width and height of every chart there."""
        for chart, raster in rasters.items():
            here = self._by_chart.of(chart)
            width, height = texels[chart].tolist()
            rows = self.row[here].astype(np.int64) * raster.shape[0] // height
            columns = self.column[here].astype(np.int64) * raster.shape[1] // width
            self.rgb.reshape(-1, 3)[self.pixel[here]] = raster[rows, columns]

    @cached_property
    def _by_chart(self) -> Grouped:
        return Grouped(self.chart)


def aim(scene: Scene, camera: Camera, *, samples: int = 2) -> Picture:
    """Which texel every pixel shows. Rays are `samples` times denser per axis; average the picture down after painting."""
    dense = Camera(
        camera.position, camera.target, camera.field_of_view, (camera.size[0] * samples, camera.size[1] * samples)
    )
    rays = dense.rays()
    depth, chart = scene.caster.cast(camera.position, rays)
    up = np.clip(rays[..., 2:], 0, 1) ** 0.6
    rgb = (SKY_LOW + (SKY_HIGH - SKY_LOW) * up).astype(np.uint8)
    pixel = np.flatnonzero(chart.reshape(-1) != MISS)
    hit = chart.reshape(-1)[pixel]
    points = camera.position + rays.reshape(-1, 3)[pixel] * depth.reshape(-1)[pixel, None]
    return Picture(rgb, pixel, hit, *scene.locate(points, hit))


def file_of(rgb: np.ndarray, format: str, **options: int) -> bytes:
    """A picture (h, w, 3) uint8 as a file of a format and with options of Pillow."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(rgb).save(buffer, format, **options)
    return buffer.getvalue()


def draw_facade(label_map: np.ndarray, lattice: Lattice) -> np.ndarray:
    """A parse in its colours with the lattice's split lines over it, (h, w, 3) uint8."""
    drawn = colourise(label_map)
    height, width = label_map.shape
    for row in lattice.rows:
        drawn[min(row, height - 1)] = 255
    for column in lattice.columns:
        drawn[:, min(column, width - 1)] = 255
    return drawn


def draw_layout(image: np.ndarray, hidden: np.ndarray, elements: Sequence[Sequence[Any]]) -> np.ndarray:
    """Elements over a texture (h, w, 3): outlined where they were seen, filled where the completion made them.

    elements: rows of label, x0, y0, x1, y1 in texels and confidence. The texture is enlarged by a whole number.
    """
    import cv2

    times = max(1, -(-LAYOUT_HEIGHT // image.shape[0]))
    drawn = np.repeat(np.repeat(image, times, axis=0), times, axis=1)
    for name, *box, _ in elements:
        x0, y0, x1, y1 = (round(value) for value in box)
        colour = COLOURS[CLASSES.index(name)] if name in CLASSES else np.full(3, 128, np.uint8)
        part = hidden[max(0, y0) : y1, max(0, x0) : x1]
        if part.size and part.mean() > COMPLETED:
            area = drawn[max(0, y0) * times : y1 * times, max(0, x0) * times : x1 * times]
            area[:] = (0.45 * area + 0.55 * colour).astype(np.uint8)
        cv2.rectangle(drawn, (x0 * times, y0 * times), (x1 * times - 1, y1 * times - 1), colour.tolist(), 2)
    return drawn
