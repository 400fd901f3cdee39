"""Perspective views of published streets from where people stand: which there are, and what they show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from benchmarks.look.outputs import Output
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import PictureInProgress, average_samples, cast_view
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS

SIZE = (300, 400)
FIELD_OF_VIEW = 75.0
EYE_M, PITCH = 1.7, 0.09
# Degrees between where a camera looks and the street that it stands on.
TURNED = (30.0, 60.0)
# Rays along each side of a pixel.
SAMPLES = 2
# A view is taken where nothing stands nearer than this in its middle, and walls take at least this share of it.
NEAREST_M, LEAST_WALLS = 4.0, 0.35
# Views whose samples are held at once.
_AT_ONCE = 8
_ABOVE_M = 500.0


@dataclass(frozen=True)
class View:
    """What a camera shows: rgb (h, w, 3) uint8; distance (h, w) metres, inf for sky; chart (h, w), MISS for sky; above (h, w)
    metres over the ground under the camera."""

    camera: PerspectiveCamera
    rgb: np.ndarray
    distance: np.ndarray
    chart: np.ndarray
    above: np.ndarray


def street_cameras(outputs: Sequence[Output], count: int, seed: int) -> list[list[PerspectiveCamera]]:
    """Cameras on the centrelines of the first output's streets that show streets in all outputs: `count` lists of one for each,
    at the same place and in the same direction, on each output's own ground."""
    rng = np.random.default_rng(seed)
    lines = outputs[0].streets
    share = np.array([line.length for line in lines])
    found: list[list[PerspectiveCamera]] = []
    for _ in range(400 * count):
        if len(found) == count:
            break
        line = lines[rng.choice(len(lines), p=share / share.sum())]
        at = rng.uniform(0, line.length)
        here, ahead = (shapely.get_coordinates(line.interpolate(d))[0] for d in (at, min(at + 0.5, line.length)))
        back = shapely.get_coordinates(line.interpolate(max(at - 0.5, 0.0)))[0]
        turn = np.radians(rng.uniform(*TURNED)) * rng.choice([-1, 1]) + np.pi * rng.integers(2)
        heading = np.arctan2(*(ahead - back)[::-1]) + turn
        cameras = [standing(output, here, heading) for output in outputs]
        if all(camera and shows_street(output, camera) for output, camera in zip(outputs, cameras, strict=True)):
            found.append([camera for camera in cameras if camera])
    if len(found) < count:
        raise SystemExit(f"benchmarks.look: {outputs[0].name} has streets for {len(found)} views only; ask for fewer")
    return found


def standing(output: Output, place: np.ndarray, heading: float) -> PerspectiveCamera | None:
    """A camera at eye height over a place (2,), heading in radians anticlockwise from east; None where no ground is under the
    sky."""
    top = np.array([*place, output.mesh.vertices[:, 2].max() + _ABOVE_M])
    depth, chart = output.caster.cast(top, np.array([[0.0, 0.0, -1.0]]))
    if chart[0] == MISS or output.charts.kind[chart[0]] != ChartKind.GROUND:
        return None
    position = top - [0, 0, float(depth[0]) - EYE_M]
    return PerspectiveCamera(
        position, position + np.array([np.cos(heading), np.sin(heading), PITCH]), FIELD_OF_VIEW, SIZE
    )


def shows_street(output: Output, camera: PerspectiveCamera, nearest: float = NEAREST_M) -> bool:
    """Whether walls take enough of a view, and nothing stands right before it."""
    rays = PerspectiveCamera(camera.position, camera.target, camera.field_of_view, (27, 36)).rays()
    depth, chart = output.caster.cast(camera.position, rays)
    kind = np.where(chart == MISS, -1, output.charts.kind[chart])
    return bool((kind == ChartKind.WALL).mean() >= LEAST_WALLS and np.median(depth[9:18, 12:24]) >= nearest)


def render(output: Output, cameras: Sequence[PerspectiveCamera]) -> Iterator[View]:
    """What the cameras show of the published pages."""
    for first in range(0, len(cameras), _AT_ONCE):
        yield from _render(output, cameras[first : first + _AT_ONCE])


def _render(output: Output, cameras: Sequence[PerspectiveCamera]) -> list[View]:
    pictures = [cast_view(output.scene, camera, samples=SAMPLES) for camera in cameras]
    charts = np.unique(np.concatenate([picture.visible_charts for picture in pictures]))
    for page in np.unique(output.placement.page[charts]).tolist():
        pixels = output.pixels(page)
        for chart in charts[output.placement.page[charts] == page].tolist():
            raster = {chart: np.ascontiguousarray(output.raster(pixels, chart))}
            for picture in pictures:
                picture.paint(raster)
    return [_view(camera, picture) for camera, picture in zip(cameras, pictures, strict=True)]


def _view(camera: PerspectiveCamera, picture: PictureInProgress) -> View:
    """Without haze, which would hide what is measured."""
    shape = picture.rgb.shape[:2]
    distance, chart = np.full(shape, np.inf, np.float32), np.full(shape, MISS, np.int32)
    distance.reshape(-1)[picture.pixel], chart.reshape(-1)[picture.pixel] = picture.depth, picture.chart
    middle = (slice(SAMPLES // 2, None, SAMPLES),) * 2
    rise = camera.rays()[..., 2]
    above = EYE_M + np.where(np.isfinite(distance[middle]), distance[middle], 0) * rise
    return View(camera, average_samples(picture.rgb, SAMPLES), distance[middle], chart[middle], above)
