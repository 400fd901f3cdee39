"""Position of a posed panorama from outlines: corners, eaves and silhouettes of the mesh against image edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int16Array, Int64Array, UInt8Array
from facade_core.core.lens_projection import lens_array, project_ray
from facade_core.core.numba_cache import njit
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import (
    NO_TURN_PX,
    camera_from_world,
    camera_position,
    is_in_view,
    pixels_per_radian,
    project_directions_to_picture,
)
from facade_core.imagery.poses.settings import OUTLINES


@dataclass(frozen=True, slots=True, eq=False)
class OutlineSamples:
    """Samples of visible mesh edges, in groups of neighbours on one edge.

    Attributes
    ----------
    point : (k, 3) world positions.
    along : (k, 3) directions of the edges.
    group : (k,) int64 group of each sample, ascending from 0.
    weight : (groups,) angular length in radians, times inner_weight where the sky is not behind.
    building : (groups,) int64 building of each group.
    """

    point: Float64Array
    along: Float64Array
    group: Int64Array
    weight: Float64Array
    building: Int64Array

    def select_building(self, building: int) -> OutlineSamples:
        """Return the samples of one building."""
        own = self.building[self.group] == building
        groups, group = np.unique(self.group[own], return_inverse=True)
        return OutlineSamples(
            self.point[own], self.along[own], group.reshape(-1), self.weight[groups], self.building[groups]
        )


@dataclass(frozen=True, slots=True, eq=False)
class Gradients:
    """Colour gradients of a panorama.

    Attributes
    ----------
    slope : (h, w, 6) int16, three channels across, then three down, in eighths of grey levels per pixel.
    turn : pixels of a full turn, NO_TURN_PX of a lens.
    left : first column of the picture in the full panorama.
    top : first row likewise.
    blur : blur in pixels.
    """

    slope: Int16Array
    turn: float
    left: float
    top: float
    blur: float


@dataclass(frozen=True, slots=True, eq=False)
class CameraPositionEstimate:
    """Position found near a pose.

    Attributes
    ----------
    offset : (3,) metres from the pose.
    turn_deg : change of the heading, clockwise from above.
    fit : fit of the outlines there, 0 to 1.
    covariance : (4, 4) of offset and turn_deg.
    """

    offset: Float64Array
    turn_deg: float
    fit: float
    covariance: Float64Array


def sample_visible_outlines(scene: Scene, pose: Pose) -> OutlineSamples:
    """Sample the edges of walls and roofs that a camera sees against other surfaces or the sky.

    A lens shows a part of them.
    """
    centre = camera_position(pose)
    ends, building = _surface_edges(scene, centre)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.maximum(1, (length / OUTLINES.sample_spacing_m).astype(int))
    edge = np.repeat(np.arange(len(ends)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    along = (ends[:, 1] - ends[:, 0]) / np.maximum(length, 1e-9)[:, None]
    point = ends[edge, 0] + ((number + 0.5) / count[edge] * length[edge])[:, None] * along[edge]
    along = along[edge]
    if pose.lens is not None:
        is_shown = is_in_view(project_directions_to_picture(point - centre, pose), pose)
        point, along, edge, number = point[is_shown], along[is_shown], edge[is_shown], number[is_shown]
    is_visible, is_sky = _visible_outline(scene, centre, point, along)
    point, along, edge, number, is_sky = (
        point[is_visible],
        along[is_visible],
        edge[is_visible],
        number[is_visible],
        is_sky[is_visible],
    )
    group_keys, group = np.unique(
        np.column_stack([edge, number // OUTLINES.samples_per_group]), axis=0, return_inverse=True
    )
    group = group.reshape(-1)
    rays = point - centre
    distance = np.linalg.norm(rays, axis=1)
    sine = np.linalg.norm(np.cross(along, rays), axis=1) / distance
    weight = np.bincount(
        group,
        OUTLINES.sample_spacing_m * sine / distance * np.where(is_sky, 1.0, OUTLINES.inner_weight),
        minlength=len(group_keys),
    )
    weight[np.bincount(group, minlength=len(group_keys)) < 3] = 0
    return OutlineSamples(
        point, along, group.astype(np.int64), np.asarray(weight, np.float64), building[group_keys[:, 0]]
    )


def _surface_edges(scene: Scene, place: Float64Array) -> tuple[Float64Array, Int64Array]:
    """Outline edges (k, 2, 3) of surfaces other than the ground near a position, and the building (k,) of each."""
    mesh, charts = scene.mesh, scene.charts
    corners = mesh.vertices[mesh.triangles]
    near = (np.linalg.norm(corners - place, axis=2).min(axis=1) < OUTLINES.max_outline_distance_m) & (
        charts.kind[mesh.chart] != ChartKind.GROUND
    )
    triangles, surface = corners[near], charts.surface[mesh.chart[near]]
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    _, index = np.unique(np.round(sides.reshape(-1, 3) * 100).astype(np.int64), axis=0, return_inverse=True)
    pair = np.sort(index.reshape(-1, 2), axis=1)
    key = np.column_stack([np.repeat(surface, 3), pair])
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    single = np.sort(first[count == 1])
    _, once = np.unique(pair[single], axis=0, return_index=True)  # edges that two surfaces share, once
    kept = single[np.sort(once)]
    return sides[kept], charts.building[mesh.chart[near]].astype(np.int64)[kept // 3]


def _visible_outline(
    scene: Scene, place: Float64Array, point: Float64Array, along: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Return (k,) bool each: samples (k, 3) between two surfaces, and samples with sky on a side.

    The ground is excluded.
    """
    charts = scene.charts
    rays = point - place
    distance = np.linalg.norm(rays, axis=1)
    across = np.cross(along, rays)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    normal, plane = charts.normals(), np.einsum("ij,ij->i", charts.normals(), charts.origin)
    depths, hits = [], []
    for side in (1, -1):
        tilted = rays + side * np.tan(np.radians(OUTLINES.side_offset_deg)) * distance[:, None] * across
        depth, hit = scene.caster.cast(place, tilted)
        depths.append(depth)
        hits.append(hit)
    first_hit, second_hit = hits
    nearest = np.minimum(*depths)
    is_visible = (nearest * distance > distance - OUTLINES.outline_tolerance_m - 0.15 * distance) & (nearest < 1.5)
    front_depth, _ = scene.caster.cast(
        place,
        rays * (1 - OUTLINES.outline_tolerance_m / np.maximum(distance, 2 * OUTLINES.outline_tolerance_m))[:, None],
    )
    is_visible &= front_depth >= 1.0
    is_coplanar = (
        np.einsum("ij,ij->i", normal[first_hit], normal[second_hit]) > np.cos(np.radians(OUTLINES.same_normal_deg))
    ) & (np.abs(plane[first_hit] - plane[second_hit]) < OUTLINES.same_plane_m)
    is_same = (
        (first_hit >= 0) & (second_hit >= 0) & is_coplanar & (charts.building[first_hit] == charts.building[second_hit])
    )
    is_ground = ((first_hit >= 0) & (charts.kind[first_hit] == ChartKind.GROUND)) | (
        (second_hit >= 0) & (charts.kind[second_hit] == ChartKind.GROUND)
    )
    return is_visible & ~is_same & ~is_ground & (distance < OUTLINES.max_outline_distance_m) & (distance > 1.0), (
        first_hit < 0
    ) | (second_hit < 0)


def image_gradients(image: UInt8Array, pose: Pose, turn_pixels: int, blur: float) -> Gradients:
    """Compute the gradients of a picture after downscaling.

    Parameters
    ----------
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : pose of the camera.
    turn_pixels : pixels of a full turn at most, of a lens on its axis.
    blur : Gaussian blur in pixels.
    """
    import cv2

    left, top, width, _ = pose.view
    shrink = min(1.0, turn_pixels * width / image.shape[1])
    if pose.lens is not None:
        shrink = min(1.0, turn_pixels / (2 * np.pi) / pixels_per_radian(pose, image.shape[1]))
    size = (round(image.shape[1] * shrink), round(image.shape[0] * shrink))
    downscaled = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if shrink < 1 else image
    rim = int(4 * blur)
    border = cv2.BORDER_WRAP if width == 1 and pose.lens is None else cv2.BORDER_REPLICATE
    wrapped = cv2.copyMakeBorder(downscaled, 0, 0, rim, rim, border)
    soft = cv2.GaussianBlur(wrapped, (0, 0), blur)
    slope = [cv2.Sobel(soft, cv2.CV_16S, *order, ksize=3)[:, rim:-rim] for order in ((1, 0), (0, 1))]
    turn = size[0] / width
    if pose.lens is not None:
        return Gradients(np.concatenate(slope, axis=2), NO_TURN_PX, 0.0, 0.0, blur)
    return Gradients(np.concatenate(slope, axis=2), turn, left * turn, top * turn / 2, blur)


def outline_fit(
    outline: OutlineSamples, picture: Gradients, pose: Pose, offset: Float64Array, turn_deg: float = 0.0
) -> float:
    """Compute the fit of an outline to image edges, 0 to 1.

    Parameters
    ----------
    outline : samples of the mesh.
    picture : gradients of the panorama.
    pose : pose of the camera.
    offset : (3,) translation of the pose in metres.
    turn_deg : rotation about the vertical.
    """
    if len(outline.group) == 0 or outline.weight.sum() == 0:
        return 0.0
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    camera = camera_from_world(pose) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    place = camera_position(pose) + offset
    geometry = (picture.turn, picture.left, picture.top)
    response = _edge_response(
        outline.point,
        outline.along,
        outline.group,
        place,
        camera,
        geometry,
        lens_array(pose.lens),
        picture.slope,
        len(outline.weight),
    )
    step = response / 8 * picture.blur * np.sqrt(2 * np.pi)
    return float((outline.weight * np.minimum(step / OUTLINES.full_step, 1)).sum() / outline.weight.sum())


def coarse_and_fine_gradients(image: UInt8Array, pose: Pose) -> tuple[Gradients, Gradients]:
    """Compute the gradients of a panorama at the coarse and the fine resolution."""
    return image_gradients(image, pose, *OUTLINES.coarse_resolution), image_gradients(
        image, pose, *OUTLINES.fine_resolution
    )


def fit_camera_position(
    outline: OutlineSamples,
    pictures: tuple[Gradients, Gradients],
    pose: Pose,
    *,
    heading_deg: float,
    height_is_assumed: bool = False,
) -> CameraPositionEstimate:
    """Fit the camera position near a pose at which mesh outlines match image edges best.

    Searches a grid on coarse gradients, then runs simplexes on coarse and fine ones. Positions farther from the pose
    must fit better.

    Parameters
    ----------
    outline : samples of the mesh.
    pictures : coarse and fine gradients, see `coarse_and_fine_gradients`.
    pose : pose to start from.
    heading_deg : expected error of the heading in degrees.
    height_is_assumed : the pose's height is the usual camera height above the ground, or the roofs around have guessed
        heights; then neither corrects the other.
    """
    from scipy.optimize import minimize

    pulls = np.array(
        [
            OUTLINES.horizontal_cost,
            OUTLINES.horizontal_cost,
            OUTLINES.assumed_height_cost if height_is_assumed else OUTLINES.stated_height_cost,
        ]
    )

    def cost(picture: Gradients, v: Float64Array) -> float:
        pull = float(pulls @ v[:3] ** 2) + OUTLINES.turn_cost * float(v[3] / heading_deg) ** 2
        return pull - outline_fit(outline, picture, pose, v[:3], float(v[3]))

    coarse, fine = pictures
    level = np.arange(-OUTLINES.search_horizontal_m, OUTLINES.search_horizontal_m + 1e-9, OUTLINES.horizontal_step_m)
    height = np.arange(-OUTLINES.search_vertical_m, OUTLINES.search_vertical_m + 1e-9, OUTLINES.vertical_step_m)
    turns = np.arange(-2, 3) * heading_deg / 2 if heading_deg > 0.2 else np.zeros(1)
    grid = np.stack(np.meshgrid(level, level, height, turns, indexing="ij"), axis=-1).reshape(-1, 4)
    best = grid[int(np.argmin([cost(coarse, v) for v in grid]))]
    for picture, size in ((coarse, OUTLINES.horizontal_step_m / 2), (fine, OUTLINES.horizontal_step_m / 4)):
        corners = best + np.vstack(
            [
                np.zeros(4),
                np.diag([size, size, size * OUTLINES.vertical_step_m / OUTLINES.horizontal_step_m, heading_deg / 2]),
            ]
        )
        options = {"initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-5, "maxiter": 200}
        best = minimize(lambda v, p=picture: cost(p, v), best, method="Nelder-Mead", options=options).x
    turn_deg = float(best[3])
    return CameraPositionEstimate(
        best[:3],
        turn_deg,
        outline_fit(outline, fine, pose, best[:3], turn_deg),
        _fit_covariance(
            lambda v: -outline_fit(outline, coarse, pose, v[:3], float(v[3])),
            best,
            np.array([OUTLINES.horizontal_step_m, OUTLINES.horizontal_step_m, OUTLINES.horizontal_step_m, heading_deg]),
            np.where([False, False, height_is_assumed, False], OUTLINES.max_assumed_height_sigma_m, OUTLINES.max_sigma),
        ),
    )


def _fit_covariance(
    cost: Callable[[Float64Array], float], best: Float64Array, steps: Float64Array, expected: Float64Array
) -> Float64Array:
    """Return the covariance (4, 4) at the minimum.

    It is the inverse curvature over `steps` times sigma_cost, bounded by the errors `expected`.

    The fit hardly changes along an edge, or with distance to a far edge: height and distance are correlated.
    """
    offsets = np.diag(steps)
    curvature = np.empty((4, 4))
    for i in range(4):
        for j in range(i, 4):
            values_at = [cost(best + a * offsets[i] + b * offsets[j]) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            curvature[i, j] = curvature[j, i] = (values_at[0] - values_at[1] - values_at[2] + values_at[3]) / (
                4 * steps[i] * steps[j]
            )
    values, axes = np.linalg.eigh(curvature * np.outer(expected, expected))  # in standard errors
    scaled = axes / np.maximum(values, OUTLINES.sigma_cost) @ axes.T
    return np.asarray(OUTLINES.sigma_cost * scaled * np.outer(expected, expected))


@njit(cache=True, nogil=True)
def _edge_response(
    point: Float64Array,
    along: Float64Array,
    group: Int64Array,
    place: Float64Array,
    camera: Float64Array,
    geometry: tuple[float, float, float],
    lens: Float64Array,
    slope: Int16Array,
    groups: int,
) -> Float64Array:
    """Mean gradient across the edge over each group's samples, absolute values averaged over channels: (groups,)."""
    rows, columns = slope.shape[:2]
    turn, left, top = geometry
    total = np.zeros((groups, 3))
    count = np.zeros(groups)
    at = np.empty((2, 2))
    c = np.empty(3)
    for k in range(len(point)):
        for end in range(2):
            for i in range(3):
                c[i] = 0.0
                for j in range(3):
                    c[i] += camera[i, j] * (point[k, j] + 0.02 * end * along[k, j] - place[j])
            if len(lens):
                share_x, share_y = project_ray(lens, c[0], c[1], c[2])
                at[end, 0], at[end, 1] = share_x * columns, share_y * rows
                continue
            at[end, 0] = (np.arctan2(c[0], c[2]) / (2 * np.pi) + 0.5) * turn - left
            at[end, 1] = (0.5 + np.arctan2(c[1], np.hypot(c[0], c[2])) / np.pi) * turn / 2 - top
        if not np.isfinite(at).all():
            count[group[k]] += 1
            continue
        du, dv = at[1, 0] - at[0, 0], at[1, 1] - at[0, 1]
        du -= turn * np.round(du / turn)
        norm = np.hypot(du, dv) + 1e-12
        x, y = at[0, 0] % turn - 0.5, at[0, 1] - 0.5
        x0, y0 = int(np.floor(x)), int(np.floor(y))
        count[group[k]] += 1
        if y0 < 0 or y0 + 1 >= rows or x0 >= columns:
            continue
        fx, fy = x - x0, y - y0
        for dy in range(2):
            for dx in range(2):
                w = (fx if dx else 1 - fx) * (fy if dy else 1 - fy)
                column = (x0 + dx) % int(turn)
                if column >= columns:
                    continue
                for channel in range(3):
                    across = slope[y0 + dy, column, channel] * (-dv) + slope[y0 + dy, column, channel + 3] * du
                    total[group[k], channel] += w * across / norm
    response = np.zeros(groups)
    for g in range(groups):
        for channel in range(3):
            response[g] += abs(total[g, channel]) / max(count[g], 1) / 3
    return response
