"""Rendering of the textured block by a perspective camera, and pictures of parses and layouts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.grouping import RowsByValue
from facade_core.core.labels import CLASSES, COLOURS, colourise
from facade_core.core.types import Lattice
from facade_core.export.pictures import filtering
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.settings import DRAWINGS
from facade_core.export.pictures.surroundings import SurroundingView
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.settings import SKY_LOOK
from facade_core.street.lighting.sky import HORIZON_COLOUR, backdrop_colour

# Pixels per batch: few enough that temporary arrays stay below the size that malloc returns to the system
# (`flows.memory`). Mapping new pages for every temporary array took half of the time.
MAX_BATCH_PIXELS = 1 << 15

# Element of a layout in a record: label, x0, y0, x1, y1 in texels, and confidence.
ElementRow = tuple[str, float, float, float, float, *tuple[float | str, ...]]


@dataclass(frozen=True)
class PictureInProgress:
    """Picture in progress: sky is drawn, pixels of the block wait for the rasters of their charts.

    Attributes
    ----------
    scene : scene of the block.
    camera : camera with the dense samples.
    rgb : (h, w, 3) uint8.
    pixel : (k,) flat indices of the block's pixels.
    chart : (k,) chart of each.
    depth : (k,) float32 distance of each, metres.
    covered : (c,) flat indices of the pixels that show surroundings.
    """

    scene: Scene
    camera: PerspectiveCamera
    rgb: UInt8Array
    pixel: Int64Array
    chart: Int32Array
    depth: Float32Array
    covered: Int64Array = field(default_factory=lambda: np.zeros(0, np.int64))

    @cached_property
    def visible_charts(self) -> Int32Array:
        """Return the visible charts (c,), ascending."""
        return np.unique(self.chart)

    def paint(self, rasters: Mapping[int, UInt8Array]) -> None:
        """Paint, in place, the pixels of some charts from their rasters.

        Sampling is bilinear, and averages the footprint of pixels larger than a texel.

        Parameters
        ----------
        rasters : raster (h, w, 3) by chart; it may be coarser than the atlas.
        """
        for chart, raster in rasters.items():
            if len(self._by_chart.rows_with(chart)):
                self.paint_chart(chart, raster.shape, self.build_levels(chart, raster))

    def build_levels(self, chart: int, raster: UInt8Array) -> filtering.MipPyramid:
        """Return the mip levels of a chart's raster that its pixels need; those of a denser picture need no more."""
        depth, density = self.depth[self._by_chart.rows_with(chart)], self._texel_density(chart, raster.shape)
        coarsest = float(depth.max(initial=0.0) / self._pinhole.focal * density.max())
        return filtering.build_mip_pyramid(raster, coarsest * filtering.MAX_ANISOTROPY)

    def paint_chart(self, chart: int, shape: tuple[int, ...], levels: filtering.MipPyramid) -> None:
        """Paint, in place, the pixels of a chart from the mip levels of its raster, whose shape is given."""
        here, charts = self._by_chart.rows_with(chart), self.scene.charts
        density = self._texel_density(chart, shape)
        flat, origin = self.rgb.reshape(-1, 3), charts.origin[chart]
        filtering.paint_pixels(
            flat, self.pixel[here], self.depth[here], self._pinhole, origin, self._chart_axes[chart], density, levels
        )

    def _texel_density(self, chart: int, shape: tuple[int, ...]) -> Float64Array:
        """Return the texels a metre (2,) to the right and down of a raster of a chart."""
        place = self.scene.placement
        density: Float64Array = place.texels_per_metre[chart] * (
            np.array(shape[1::-1]) / (place.width[chart], place.height[chart])
        )
        return density

    @cached_property
    def _pinhole(self) -> filtering.PinholeCamera:
        height, width = self.camera.size
        return filtering.PinholeCamera(self.camera.position, *self.camera.axes(), width, height)

    @cached_property
    def _chart_axes(self) -> Float64Array:
        """Return right, down and outward (n, 3, 3) of the charts."""
        charts = self.scene.charts
        return np.stack([charts.axis_u, charts.axis_v, charts.normals()], axis=1)

    def apply_haze(self, nearest: float | None = None) -> UInt8Array:
        """Return the painted picture (h, w, 3) uint8 with haze that grows from a distance, by default the nearest pixel's."""
        nearest = self.depth.min(initial=np.inf) if nearest is None else nearest
        drawn = self.rgb.copy().reshape(-1, 3)
        for some in np.array_split(np.arange(len(self.pixel)), 1 + len(self.pixel) // MAX_BATCH_PIXELS):
            share = (1 - np.exp((nearest - self.depth[some]) / SKY_LOOK.haze_m))[:, None].astype(np.float32)
            here = self.pixel[some]
            drawn[here] = (drawn[here] * (1 - share) + HORIZON_COLOUR.astype(np.float32) * share + 0.5).astype(np.uint8)
        return drawn.reshape(self.rgb.shape)

    @cached_property
    def _by_chart(self) -> RowsByValue:
        return RowsByValue(self.chart)


@dataclass(frozen=True)
class SmoothPicture:
    """Picture in progress with one ray a pixel, and more where two charts or the sky meet.

    Attributes
    ----------
    coarse : picture with one ray a pixel; its filtering averages what a pixel covers of one chart.
    fine : picture with the rays of `edges` alone.
    edges : (k,) flat indices of the coarse picture's pixels that show more than one chart.
    """

    coarse: PictureInProgress
    fine: PictureInProgress
    edges: Int64Array

    @cached_property
    def visible_charts(self) -> Int32Array:
        """Return the visible charts (c,), ascending."""
        return np.union1d(self.coarse.visible_charts, self.fine.visible_charts)

    def paint(self, rasters: Mapping[int, UInt8Array]) -> None:
        """Paint, in place, the pixels of some charts from their rasters (see `PictureInProgress.paint`)."""
        shown = set(self.visible_charts.tolist())
        for chart, raster in rasters.items():
            if chart in shown:
                levels = self.coarse.build_levels(chart, raster)
                for picture in (self.coarse, self.fine):
                    picture.paint_chart(chart, raster.shape, levels)

    def finish(self) -> UInt8Array:
        """Return the painted picture (h, w, 3) uint8 with haze."""
        nearest = min(float(picture.depth.min(initial=np.inf)) for picture in (self.coarse, self.fine))
        drawn, dense = self.coarse.apply_haze(nearest), self.fine.apply_haze(nearest)
        averaged = average_samples(dense, dense.shape[0] // drawn.shape[0])
        drawn.reshape(-1, 3)[self.edges] = averaged.reshape(-1, 3)[self.edges]
        return drawn


def cast_smooth_view(
    scene: Scene, camera: PerspectiveCamera, *, samples: int, around: SurroundingView | None = None
) -> SmoothPicture:
    """Cast the rays of a picture, `samples` along each side of the pixels where charts meet, and one of all others.

    Parameters
    ----------
    scene, camera, around : as of `cast_view`.
    samples : rays along each side of a pixel where charts meet.
    """
    height, width = camera.size
    coarse = cast_view(scene, camera, samples=1, around=around)
    chart = np.full(height * width, MISS, np.int32)
    chart[coarse.pixel] = coarse.chart
    chart[coarse.covered] = MISS - 1
    edges = np.flatnonzero(_meets_another(chart.reshape(height, width)))
    dense = replace(camera, size=(height * samples, width * samples))
    within = np.arange(samples)
    rows, columns = (samples * place[:, None] + within for place in np.divmod(edges, width))
    pixel = (rows[:, :, None] * dense.size[1] + columns[:, None, :]).reshape(-1)
    rgb = np.zeros((*dense.size, 3), np.uint8)
    depth, found = np.empty(len(pixel), np.float32), np.empty(len(pixel), np.int32)
    for first in range(0, len(pixel), MAX_BATCH_PIXELS):
        some = slice(first, first + MAX_BATCH_PIXELS)
        rays = dense.rays_through(pixel[some])
        depth[some], found[some] = scene.caster.cast(camera.position, rays)
        missed = found[some] == MISS
        rgb.reshape(-1, 3)[pixel[some][missed]] = backdrop_colour(rays[missed])
        if around is not None:
            drawn = rgb.reshape(-1, 3)[pixel[some]]
            around.cover(camera.position, rays, depth[some], found[some], drawn)
            rgb.reshape(-1, 3)[pixel[some]] = drawn
    hit = found != MISS
    return SmoothPicture(coarse, PictureInProgress(scene, dense, rgb, pixel[hit], found[hit], depth[hit]), edges)


def _meets_another(chart: Int32Array) -> BoolArray:
    """Return the pixels (h, w) with another chart beside, above or below."""
    meets = np.zeros(chart.shape, bool)
    for one, other in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        differ = chart[one] != chart[other]
        meets[one] |= differ
        meets[other] |= differ
    return meets


def cast_view(
    scene: Scene, camera: PerspectiveCamera, *, samples: int = 2, around: SurroundingView | None = None
) -> PictureInProgress:
    """Cast the rays of a picture and return it with only the sky and the surroundings drawn.

    Parameters
    ----------
    scene : scene of the block.
    camera : the camera.
    samples : rays per pixel and axis; average the picture after painting.
    around : surroundings of the block; None without.
    """
    size = (camera.size[0] * samples, camera.size[1] * samples)
    dense = replace(camera, size=size)
    depth, chart, rgb = np.empty(size, np.float32), np.empty(size, np.int32), np.zeros((*size, 3), np.uint8)
    covered = np.zeros(size, bool)
    band = max(1, MAX_BATCH_PIXELS // size[1])
    for top in range(0, size[0], band):
        rows = slice(top, top + band)
        rays = dense.rays(rows)
        depth[rows], chart[rows] = scene.caster.cast(camera.position, rays)
        missed = chart[rows] == MISS
        rgb[rows][missed] = backdrop_colour(rays[missed])
        if around is not None:
            covered[rows] = around.cover(camera.position, rays, depth[rows], chart[rows], rgb[rows])
    pixel = np.flatnonzero(chart.reshape(-1) != MISS)
    found, away = chart.reshape(-1)[pixel], depth.reshape(-1)[pixel]
    return PictureInProgress(scene, dense, rgb, pixel, found, away, np.flatnonzero(covered))


def render_perspective(
    scene: Scene, camera: PerspectiveCamera, raster: Callable[[int], UInt8Array], *, samples: int = 2
) -> UInt8Array:
    """Render the textured block with filtering, sky and haze.

    Published pages give rasters as follows:

        with published(out) as found:
            camera = PerspectiveCamera.from_heading(position, heading=40, pitch=3, field_of_view=75, size=(900, 1440))
            rgb = render_perspective(found.plan.scene, camera, found.textured_mesh.raster)

    Parameters
    ----------
    scene : scene of the block.
    camera : the camera.
    raster : returns the raster (h, w, 3) uint8 of a chart.
    samples : rays per pixel and axis.

    Returns
    -------
    (h, w, 3) uint8.
    """
    picture = cast_view(scene, camera, samples=samples)
    for chart in picture.visible_charts[
        np.argsort(scene.placement.page[picture.visible_charts], kind="stable")
    ].tolist():
        picture.paint({chart: raster(chart)})
    return average_samples(picture.apply_haze(), samples)


def average_samples(rgb: UInt8Array, samples: int) -> UInt8Array:
    """Average a picture (h * samples, w * samples, 3) to (h, w, 3) uint8."""
    import cv2

    size = (rgb.shape[1] // samples, rgb.shape[0] // samples)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


def encode_image(rgb: UInt8Array, format: str, **options: int) -> bytes:
    """Encode a picture (h, w, 3) uint8 with a format and options of Pillow."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(rgb).save(buffer, format, **options)
    return buffer.getvalue()


def draw_parse(label_map: UInt8Array, lattice: Lattice) -> UInt8Array:
    """Draw a parse in its colours with the split lines of its lattice, (h, w, 3) uint8."""
    drawn = colourise(label_map)
    height, width = label_map.shape
    for row in lattice.rows:
        drawn[min(row, height - 1)] = 255
    for column in lattice.columns:
        drawn[:, min(column, width - 1)] = 255
    return drawn


def draw_layout(image: UInt8Array, hidden: BoolArray, elements: Sequence[ElementRow]) -> UInt8Array:
    """Draw elements over a texture: outlined where seen, filled where the completion placed them.

    Parameters
    ----------
    image : (h, w, 3) texture; enlarged by a whole number.
    hidden : (h, w) bool, occluders.
    elements : rows of label, x0, y0, x1, y1 in texels, and more.
    """
    import cv2

    times = max(1, -(-DRAWINGS.min_layout_height_px // image.shape[0]))
    drawn = np.repeat(np.repeat(image, times, axis=0), times, axis=1)
    for name, *box in (row[:5] for row in elements):
        x0, y0, x1, y1 = (round(value) for value in box)
        colour = COLOURS[CLASSES.index(name)] if name in CLASSES else np.full(3, 128, np.uint8)
        part = hidden[max(0, y0) : y1, max(0, x0) : x1]
        if part.size and part.mean() > DRAWINGS.min_completed_share:
            area = drawn[max(0, y0) * times : y1 * times, max(0, x0) * times : x1 * times]
            area[:] = (0.45 * area + 0.55 * colour).astype(np.uint8)
        cv2.rectangle(drawn, (x0 * times, y0 * times), (x1 * times - 1, y1 * times - 1), colour.tolist(), 2)
    return drawn
