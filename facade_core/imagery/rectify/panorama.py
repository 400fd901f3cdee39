"""Charts from posed panoramas: which show a chart and how well, and the chart's raster from one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from facade_core.core.errors import ImageError
from facade_core.core.grouping import RowIndex
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.panorama_camera import (
    camera_from_world,
    camera_position,
    is_in_view,
    project_to_panorama,
)
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.resampling import ChartRaster, PanoramaLens, compute_footprints, resample_panorama

# Flatter than this, a wall's pixels are stretched and its balconies hide its windows.
GRAZING_DEG = 12.0
# What lies this close before a surface does not hide it: mouldings, and the noise of the model.
OCCLUSION_TOLERANCE_M = 0.05
# A sighting shows at least this share of the chart.
LEAST_SEEN = 0.02
# Points of a chart that are looked at, per axis.
SAMPLES = (12, 8)
# Panoramas farther than this do not show a chart, metres.
MAX_SIGHTING_DISTANCE_M = 150.0
# Texels between the rays that look for what hides a chart, before its outline is followed texel by texel.
SPARSE = 4
# Rays cast at once, which bounds memory.
RAYS = 1 << 18


@dataclass(frozen=True, slots=True)
class Sighting:
    """A panorama that shows a chart: its index; seen, the share of the chart; pixels_per_metre and obliquity (degrees between
    line of sight and surface), means over what is seen; score, higher is better."""

    panorama: int
    seen: float
    pixels_per_metre: float
    obliquity: float
    score: float


def find_sightings(
    scene: Scene,
    chart: int,
    poses: Sequence[Pose],
    image_sizes: Sequence[tuple[int, int]],
    *,
    reach: float = MAX_SIGHTING_DISTANCE_M,
) -> list[Sighting]:
    """Panoramas that show a chart within `reach` metres, best first; image_sizes are (height, width) in pixels.

    A point counts as seen where nothing is before it, its surface is not seen at a grazing angle and the picture's view holds
    it. The score is the share seen, less for pictures coarser than the atlas and for oblique ones, in which what stands out
    of the wall is displaced. Raises GeometryError for a pose without height.
    """
    found = []
    for view in _views(scene, chart, poses, image_sizes, reach):
        seen = float(view.usable.mean())
        if seen < LEAST_SEEN:
            continue
        resolution, facing = float(view.resolution.mean()), float(view.sine.mean())
        score = seen * min(1.0, resolution / scene.placement.texels_per_metre[chart]) * facing
        found.append(Sighting(view.panorama, seen, resolution, float(np.degrees(np.arcsin(facing))), score))
    return sorted(found, key=lambda sighting: (-sighting.score, sighting.panorama))


def nearby_panoramas(scene: Scene, charts: np.ndarray, poses: Sequence[Pose]) -> list[np.ndarray]:
    """Which panoramas may show each of some charts (n,), by where they are: indices (k,) in ascending order."""
    middle = scene.charts.points_at_shares(charts, np.array([[0.5, 0.5]]))[:, 0, :2]
    # the points that are looked for lie on the chart: as far from its middle as its diagonal is long, at most
    reach = MAX_SIGHTING_DISTANCE_M + 2 * np.hypot(*scene.charts.size[charts].T)
    places = shapely.STRtree(shapely.points(np.array([(pose.x, pose.y) for pose in poses]).reshape(-1, 2)))
    place, panorama = places.query(shapely.points(middle), predicate="dwithin", distance=reach)
    near = RowIndex(place)
    return [np.sort(panorama[near.rows_with(chart)]) for chart in range(len(charts))]


def point_visibility(
    scene: Scene, chart: int, poses: Sequence[Pose], image_sizes: Sequence[tuple[int, int]], *, reach: float = MAX_SIGHTING_DISTANCE_M
) -> np.ndarray:
    """How well panoramas show the points of a chart that `find_sightings` looks at, (panoramas, points): 0 where one does not
    see a point, else its resolution there over the atlas', at most 1, times the sine of the angle of sight."""
    points = _grid(scene, chart)
    shown = np.zeros((len(poses), len(points)))
    for view in _views(scene, chart, poses, image_sizes, reach):
        sharp = np.minimum(1.0, view.resolution / scene.placement.texels_per_metre[chart])
        shown[view.panorama, view.usable] = sharp * view.sine
    return shown


class _OfPoints(NamedTuple):
    """What a panorama sees of the points of a chart: its index; usable (points,) bool; of these the pixels per metre and the
    sine of the angle between line of sight and surface, (usable,)."""

    panorama: int
    usable: np.ndarray
    resolution: np.ndarray
    sine: np.ndarray


def _views(
    scene: Scene, chart: int, poses: Sequence[Pose], image_sizes: Sequence[tuple[int, int]], reach: float
) -> Iterator[_OfPoints]:
    """The panoramas on a chart's side within reach that see one of its points."""
    points = _grid(scene, chart)
    if len(points) == 0 or len(poses) == 0:
        return
    normal = scene.charts.normals()[chart]
    places = np.array([camera_position(pose) for pose in poses])
    middle = points.mean(axis=0)
    radius = np.linalg.norm(points - middle, axis=1).max()
    offset = places - middle
    near = (offset @ normal > 0) & (np.linalg.norm(offset, axis=1) <= reach + radius)
    for index in np.flatnonzero(near).tolist():
        pose, (_, width) = poses[index], image_sizes[index]
        rays = points - places[index]
        distance = np.linalg.norm(rays, axis=1)
        sine = -(rays @ normal) / np.maximum(distance, 1e-9)
        usable = (distance <= reach) & (sine >= np.sin(np.radians(GRAZING_DEG))) & is_in_view(project_to_panorama(rays, pose), pose)
        usable[usable] = _visible(scene, chart, places[index], rays[usable])
        if usable.any():
            pixels_per_radian = width / pose.view[2] / (2 * np.pi)
            resolution = pixels_per_radian / distance[usable] * np.sqrt(sine[usable])
            yield _OfPoints(index, usable, resolution, sine[usable])


def rectify_view(
    scene: Scene, chart: int, image: np.ndarray, pose: Pose, size: tuple[int, int], hidden: np.ndarray | None = None
) -> ChartView:
    """A chart as a panorama shows it: rgb (h, w, 3) uint8, black where not seen, seen and quality (h, w).

    image (H, W, 3) uint8 is the part pose.view of the full panorama; size (h, w) divides the chart's place in the atlas, whose
    own size gives the atlas's texels. A texel is the mean of the pixels it covers. Not seen are texels behind other surfaces,
    at a grazing angle, outside the picture or in the flat mask at its bottom; occluded are those where the panorama is hidden
    (H, W) bool. Raises GeometryError for a pose without height, ImageError for an image that is not uint8 RGB.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise ImageError(f"a panorama is uint8 RGB (h, w, 3), not {image.dtype} {image.shape}; convert it")
    charts, placement = scene.charts, scene.placement
    rows, columns = size
    place = camera_position(pose)
    right = charts.axis_u[chart] * (placement.width[chart] / placement.texels_per_metre[chart] / columns)
    down = charts.axis_v[chart] * (placement.height[chart] / placement.texels_per_metre[chart] / rows)
    corner = charts.origin[chart] - place
    left, top, width, height = pose.view
    turn, half = image.shape[1] / width, image.shape[0] / height
    footprints = np.empty((rows, columns, 6), np.float32)
    seen = np.empty((rows, columns), np.bool_)
    quality = np.empty((rows, columns), np.float32)
    compute_footprints(
        ChartRaster(corner, right, down, charts.normals()[chart]),
        PanoramaLens(camera_from_world(pose), turn, half, left * turn, top * half, *image.shape[:2]),
        np.sin(np.radians(GRAZING_DEG)),
        footprints,
        seen,
        quality,
    )
    _hide(scene, chart, place, corner, right, down, seen)
    rgb = resample_panorama(image, pose.view, footprints, seen)
    occluded = None if hidden is None else _taken(hidden, footprints, seen)
    return ChartView(rgb, seen, quality * seen, occluded)


def _taken(hidden: np.ndarray, footprints: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The seen texels (h, w) bool around which a panorama is hidden (H, W) bool; a texel beside them is hidden too."""
    import cv2

    taken = np.zeros(seen.shape, np.uint8)
    row, column = (np.clip(footprints[seen, axis].astype(np.intp), 0, hidden.shape[1 - axis] - 1) for axis in (1, 0))
    taken[seen] = hidden[row, column]
    return cv2.dilate(taken, np.ones((3, 3), np.uint8)).astype(bool) & seen


def _hide(
    scene: Scene,
    chart: int,
    place: np.ndarray,
    corner: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
    seen: np.ndarray,
) -> None:
    """Clear the seen texels that something stands before: all rays where coarse ones disagree with their neighbours."""
    import cv2

    rows, columns = seen.shape
    step = (
        np.arange(0, rows + SPARSE, SPARSE).clip(max=rows - 1),
        np.arange(0, columns + SPARSE, SPARSE).clip(max=columns - 1),
    )
    coarse = _shown(scene, chart, place, corner, right, down, *(at.ravel() for at in np.meshgrid(*step, indexing="ij")))
    coarse = coarse.reshape(len(step[0]), len(step[1])).astype(np.uint8)
    square = np.ones((2, 2), np.uint8)
    # corners of the blocks between rays, the anchor at their upper left
    all_shown = cv2.erode(coarse, square, anchor=(0, 0))[:-1, :-1].astype(bool)
    some_shown = cv2.dilate(coarse, square, anchor=(0, 0))[:-1, :-1].astype(bool)
    shown, mixed = (m.repeat(SPARSE, 0).repeat(SPARSE, 1)[:rows, :columns] for m in (all_shown, some_shown ^ all_shown))
    row, column = np.nonzero(seen & mixed)
    seen &= shown | mixed
    for start in range(0, len(row), RAYS):
        part = slice(start, start + RAYS)
        seen[row[part], column[part]] = _shown(scene, chart, place, corner, right, down, row[part], column[part])


def _shown(
    scene: Scene,
    chart: int,
    place: np.ndarray,
    corner: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
) -> np.ndarray:
    """Whether the texels at rows and columns (k,) are in sight: (k,) bool."""
    rays = corner + (row[:, None] + 0.5) * down + (column[:, None] + 0.5) * right
    return _visible(scene, chart, place, rays)


def _visible(scene: Scene, chart: int, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Whether the points origin + rays (..., 3) on a chart are in sight: (...,) bool."""
    reached, hit = scene.caster.cast(origin, rays)
    surface = scene.charts.surface
    own = (hit >= 0) & (surface[hit] == surface[chart])
    return own | ((1.0 - reached) * np.linalg.norm(rays, axis=-1) < OCCLUSION_TOLERANCE_M)


def _grid(scene: Scene, chart: int) -> np.ndarray:
    """World points (k, 3) evenly spread over a chart's own triangles."""
    charts, mesh = scene.charts, scene.mesh
    at = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in SAMPLES)), axis=-1).reshape(-1, 2)
    at = at * charts.size[chart]
    corners = mesh.vertices[mesh.triangles[mesh.chart_triangles(chart)]] - charts.origin[chart]
    flat = corners @ np.column_stack([charts.axis_u[chart], charts.axis_v[chart]])
    edge = np.roll(flat, -1, axis=1) - flat
    to = at[:, None, None] - flat
    side = edge[..., 0] * to[..., 1] - edge[..., 1] * to[..., 0]
    inside = ((side >= 0).all(axis=2) | (side <= 0).all(axis=2)).any(axis=1)
    return charts.origin[chart] + at[inside] @ np.stack([charts.axis_u[chart], charts.axis_v[chart]])
