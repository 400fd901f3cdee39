"""Charts in posed panoramas: visibility and quality, and the raster of a chart from one panorama."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.grouping import RowsByValue
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import (
    camera_position,
    camera_reach,
    is_in_view,
    pixels_per_radian_along,
    project_directions_to_picture,
)
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.resampling import (
    ChartTexelGrid,
    compute_texel_footprints,
    picture_projection,
    resample_panorama,
)

# At flatter angles a wall's pixels are stretched, and balconies hide windows.
MIN_FACING_DEG = 12.0
# Surfaces this close in front do not occlude, in metres: mouldings, and noise of the model.
OCCLUSION_TOLERANCE_M = 0.05
# Share of the chart that a sighting shows.
MIN_SIGHTING_SHARE = 0.02
# Points per axis at which a chart's visibility is sampled.
GRID_POINTS = (12, 8)
# Panoramas farther away, in metres, do not show a chart.
MAX_SIGHTING_DISTANCE_M = 150.0
# Texels between the first visibility rays; outlines of occluders are then refined texel by texel.
COARSE_STEP = 4
# Rays cast at once, which bounds memory.
MAX_RAYS = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Panorama that shows a chart.

    Attributes
    ----------
    panorama : index of the panorama.
    seen_share : share of the chart that is seen.
    pixels_per_metre : mean resolution of the seen part.
    score : higher is better.
    is_seen : (points,) bool, sample points of the chart that are seen.
    """

    panorama: int
    seen_share: float
    pixels_per_metre: float
    score: float
    is_seen: BoolArray


def find_sightings(
    scene: Scene,
    chart: int,
    poses: Sequence[Pose],
    image_sizes: Sequence[tuple[int, int]],
    *,
    max_distance: float = MAX_SIGHTING_DISTANCE_M,
    texels_per_metre: float | None = None,
) -> list[Sighting]:
    """Find the panoramas that show a chart, best first.

    A point counts as seen if nothing occludes it, the angle is not grazing and the picture contains it. The score is
    the seen share, reduced for pictures coarser than the atlas and for oblique ones, which displace protruding parts.

    Parameters
    ----------
    scene : scene that contains the chart.
    chart : index of the chart.
    poses : poses of the panoramas.
    image_sizes : height and width of the panoramas in pixels.
    max_distance : largest distance in metres.
    texels_per_metre : density below which a picture counts as coarse; None takes the chart's.

    Raises
    ------
    GeometryError
        If a pose has no height.
    """
    sightings = []
    density = scene.placement.texels_per_metre[chart] if texels_per_metre is None else texels_per_metre
    for view in _point_views(scene, chart, poses, image_sizes, max_distance):
        seen = float(view.usable.mean())
        if seen < MIN_SIGHTING_SHARE:
            continue
        resolution, facing = float(view.resolution.mean()), float(view.sine.mean())
        score = seen * min(1.0, resolution / density) * facing
        sightings.append(Sighting(view.panorama, seen, resolution, score, view.usable))
    return sorted(sightings, key=lambda sighting: (-sighting.score, sighting.panorama))


def nearby_panoramas(scene: Scene, charts: Int32Array, poses: Sequence[Pose]) -> list[Int64Array]:
    """Return the panoramas that may show each chart, by position.

    Parameters
    ----------
    scene : scene that contains the charts.
    charts : (n,) charts.
    poses : poses of the panoramas.

    Returns
    -------
    Ascending indices (k,) for each chart.
    """
    middle = scene.charts.points_at_shares(charts, np.array([[0.5, 0.5]]))[:, 0, :2]
    # sampled points are at most the diagonal's length away from the chart's middle
    margin = 2 * np.hypot(*scene.charts.size[charts].T)
    reach = np.array([camera_reach(pose, MAX_SIGHTING_DISTANCE_M) for pose in poses])
    positions = np.array([(pose.x, pose.y) for pose in poses]).reshape(-1, 2)
    places = shapely.STRtree(shapely.points(positions))
    place, panorama = places.query(
        shapely.points(middle), predicate="dwithin", distance=reach.max(initial=MAX_SIGHTING_DISTANCE_M) + margin
    )
    is_near = np.linalg.norm(positions[panorama] - middle[place], axis=1) <= reach[panorama] + margin[place]
    place, panorama = place[is_near], panorama[is_near]
    grouped = RowsByValue(place)
    return [np.sort(panorama[grouped.rows_with(chart)]) for chart in range(len(charts))]


def chart_point_view_quality(
    scene: Scene, chart: int, poses: Sequence[Pose], image_sizes: Sequence[tuple[int, int]]
) -> Float64Array:
    """Compute how well each panorama shows the sample points of a chart, 0 to 1.

    Parameters
    ----------
    scene : scene that contains the chart.
    chart : index of the chart.
    poses : poses of the panoramas.
    image_sizes : height and width of the panoramas in pixels.

    Returns
    -------
    (panoramas, points) resolution over the atlas' resolution, at most 1, times the sine of the viewing angle; 0 where
    not seen.
    """
    points = _sample_points(scene, chart)
    visibility = np.zeros((len(poses), len(points)))
    for view in _point_views(scene, chart, poses, image_sizes, MAX_SIGHTING_DISTANCE_M):
        sharpness = np.minimum(1.0, view.resolution / scene.placement.texels_per_metre[chart])
        visibility[view.panorama, view.usable] = sharpness * view.sine
    return visibility


class _PointView(NamedTuple):
    """Visibility of a chart's points in one panorama.

    Attributes
    ----------
    panorama : index of the panorama.
    usable : (points,) bool.
    resolution : (usable,) pixels per metre.
    sine : (usable,) sine of the angle between line of sight and surface.
    """

    panorama: int
    usable: BoolArray
    resolution: Float64Array
    sine: Float64Array


def _point_views(
    scene: Scene, chart: int, poses: Sequence[Pose], image_sizes: Sequence[tuple[int, int]], max_distance: float
) -> Iterator[_PointView]:
    """Panoramas on a chart's side, within a distance, that see one of its points."""
    points = _sample_points(scene, chart)
    if len(points) == 0 or len(poses) == 0:
        return
    normal = scene.charts.normals()[chart]
    places = np.array([camera_position(pose) for pose in poses])
    middle = points.mean(axis=0)
    radius = np.linalg.norm(points - middle, axis=1).max()
    offset = places - middle
    reach = np.array([camera_reach(pose, max_distance) for pose in poses])
    is_near = ((offset * normal).sum(axis=1) > 0) & (np.linalg.norm(offset, axis=1) <= reach + radius)
    for index in np.flatnonzero(is_near).tolist():
        pose, (_, width) = poses[index], image_sizes[index]
        rays = points - places[index]
        distance = np.linalg.norm(rays, axis=1)
        sine = -(rays * normal).sum(axis=1) / np.maximum(distance, 1e-9)
        usable = (
            (distance <= reach[index])
            & (sine >= np.sin(np.radians(MIN_FACING_DEG)))
            & is_in_view(project_directions_to_picture(rays, pose), pose)
        )
        usable[usable] = _are_points_visible(scene, chart, places[index], rays[usable])
        if usable.any():
            resolution = pixels_per_radian_along(pose, width, rays[usable]) / distance[usable] * np.sqrt(sine[usable])
            yield _PointView(index, usable, resolution, sine[usable])


def rectify_chart_from_panorama(
    scene: Scene,
    chart: int,
    image: UInt8Array,
    pose: Pose,
    size: tuple[int, int],
    occluded: BoolArray | None = None,
    extent: Float64Array | None = None,
) -> ChartView:
    """Rectify a chart from a panorama.

    A texel is the mean of the pixels it covers. Not seen are texels behind other surfaces, at a grazing angle, outside
    the picture or in the flat mask at its bottom.

    Parameters
    ----------
    scene : scene that contains the chart.
    chart : index of the chart.
    image : (H, W, 3) uint8, of a panorama the part `pose.view`, of a lens the whole picture at any scale.
    pose : pose of the camera.
    size : height and width of the raster; the chart's size in the atlas gives the atlas's texels.
    occluded : (H, W) bool, occluders in the panorama.
    extent : (2,) width and height of the raster in metres; None takes those of the chart's texels in the atlas.

    Returns
    -------
    The view of the chart, black where not seen.

    Raises
    ------
    GeometryError
        If the pose has no height.
    ImageError
        If the image is not uint8 RGB.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise ImageError(f"a panorama is uint8 RGB (h, w, 3), not {image.dtype} {image.shape}; convert it")
    charts, placement = scene.charts, scene.placement
    rows, columns = size
    place = camera_position(pose)
    if extent is None:
        extent = np.array([placement.width[chart], placement.height[chart]]) / placement.texels_per_metre[chart]
    right = charts.axis_u[chart] * (extent[0] / columns)
    down = charts.axis_v[chart] * (extent[1] / rows)
    corner = charts.origin[chart] - place
    footprints = np.empty((rows, columns, 6), np.float32)
    seen = np.empty((rows, columns), np.bool_)
    quality = np.empty((rows, columns), np.float32)
    raster = ChartTexelGrid(corner, right, down, charts.normals()[chart])
    compute_texel_footprints(
        raster,
        picture_projection(pose, image.shape),
        np.sin(np.radians(MIN_FACING_DEG)),
        footprints,
        seen,
        quality,
    )
    _clear_hidden(scene, chart, place, raster, seen)
    rgb = resample_panorama(image, pose, footprints, seen)
    occluded = None if occluded is None else _occluded_texels(occluded, footprints, seen)
    return ChartView(rgb, seen, quality * seen, occluded)


def _occluded_texels(hidden: BoolArray, footprints: Float32Array, seen: BoolArray) -> BoolArray:
    """Seen texels (h, w) bool that are occluded in the panorama (H, W) bool, with a rim of one texel."""
    import cv2

    is_occluded = np.zeros(seen.shape, np.uint8)
    row, column = (np.clip(footprints[seen, axis].astype(np.intp), 0, hidden.shape[1 - axis] - 1) for axis in (1, 0))
    is_occluded[seen] = hidden[row, column]
    return cv2.dilate(is_occluded, np.ones((3, 3), np.uint8)).astype(bool) & seen


def _clear_hidden(scene: Scene, chart: int, place: Float64Array, raster: ChartTexelGrid, seen: BoolArray) -> None:
    """Clear the seen texels that a surface occludes: coarse rays first, all rays where neighbours disagree."""
    import cv2

    rows, columns = seen.shape
    step = (
        np.arange(0, rows + COARSE_STEP, COARSE_STEP).clip(max=rows - 1),
        np.arange(0, columns + COARSE_STEP, COARSE_STEP).clip(max=columns - 1),
    )
    reached = _are_texels_visible(
        scene, chart, place, raster, *(at.ravel() for at in np.meshgrid(*step, indexing="ij"))
    )
    coarse = reached.reshape(len(step[0]), len(step[1])).astype(np.uint8)
    square = np.ones((2, 2), np.uint8)
    # corners of the blocks between rays, the anchor at their upper left
    all_shown = cv2.erode(coarse, square, anchor=(0, 0))[:-1, :-1].astype(bool)
    some_shown = cv2.dilate(coarse, square, anchor=(0, 0))[:-1, :-1].astype(bool)
    all_visible, is_mixed = (
        m.repeat(COARSE_STEP, 0).repeat(COARSE_STEP, 1)[:rows, :columns] for m in (all_shown, some_shown ^ all_shown)
    )
    row, column = np.nonzero(seen & is_mixed)
    seen &= all_visible | is_mixed
    for start in range(0, len(row), MAX_RAYS):
        part = slice(start, start + MAX_RAYS)
        seen[row[part], column[part]] = _are_texels_visible(scene, chart, place, raster, row[part], column[part])


def _are_texels_visible(
    scene: Scene, chart: int, place: Float64Array, raster: ChartTexelGrid, row: Int64Array, column: Int64Array
) -> BoolArray:
    """Visibility (k,) bool of the texels at rows and columns (k,)."""
    rays = raster.corner + (row[:, None] + 0.5) * raster.down + (column[:, None] + 0.5) * raster.right
    return _are_points_visible(scene, chart, place, rays)


def _are_points_visible(scene: Scene, chart: int, origin: Float64Array, rays: Float64Array) -> BoolArray:
    """Visibility (...,) bool of the points origin + rays (..., 3) on a chart."""
    reached, hit = scene.caster.cast(origin, rays)
    surface = scene.charts.surface
    is_own = (hit >= 0) & (surface[hit] == surface[chart])
    is_visible: BoolArray = is_own | ((1.0 - reached) * np.linalg.norm(rays, axis=-1) < OCCLUSION_TOLERANCE_M)
    return is_visible


def _sample_points(scene: Scene, chart: int) -> Float64Array:
    """World points (k, 3) evenly spread over a chart's own triangles."""
    charts, mesh = scene.charts, scene.mesh
    points = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in GRID_POINTS)), axis=-1).reshape(-1, 2)
    points = points * charts.size[chart]
    corners = mesh.vertices[mesh.triangles[mesh.chart_triangles(chart)]] - charts.origin[chart]
    axes = np.stack([charts.axis_u[chart], charts.axis_v[chart]])
    flat = multiply_matrices(corners, axes.T)
    edge = np.roll(flat, -1, axis=1) - flat
    offset = points[:, None, None] - flat
    side = edge[..., 0] * offset[..., 1] - edge[..., 1] * offset[..., 0]
    inside = ((side >= 0).all(axis=2) | (side <= 0).all(axis=2)).any(axis=1)
    positions: Float64Array = charts.origin[chart] + multiply_matrices(points[inside], axes)
    return positions
