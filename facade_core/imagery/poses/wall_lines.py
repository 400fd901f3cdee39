"""Rotation of a posed panorama from straight lines on walls: they are level or upright at any camera position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import (
    camera_position,
    is_in_view,
    pixels_per_radian,
    project_directions_to_picture,
)
from facade_core.imagery.poses.settings import WALL_LINES
from facade_core.imagery.rectify.line_segments import detect_line_segments
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama


@dataclass(frozen=True, slots=True, eq=False)
class WallLines:
    """Lines (k,) on walls in a panorama, in the world of its stated pose.

    Attributes
    ----------
    plane : (k, 3) unit normals of the planes through camera and line.
    axis : (k, 3) world direction that each line should have.
    wall : (k, 3) outward normals of the walls.
    weight : (k,) angular length in radians, at most 0.3.
    chart : (k,) chart of the wall.
    """

    plane: Float64Array
    axis: Float64Array
    wall: Float64Array
    weight: Float64Array
    chart: Int64Array

    def __len__(self) -> int:
        return len(self.weight)

    def slopes(self, turn: Float64Array) -> Float64Array:
        """Compute the angles (k,) in degrees between lines and axes on the rectified walls.

        A world rotation (3, 3) is applied before.
        """
        along = np.cross(self.plane @ turn.T, self.wall)
        slopes: Float64Array = (
            np.degrees(
                np.arctan2(
                    np.einsum("ij,ij->i", np.cross(self.axis, along), self.wall),
                    np.einsum("ij,ij->i", along, self.axis),
                )
                + np.pi / 2
            )
            % 180
            - 90
        )
        return slopes


def detect_wall_lines(scene: Scene, image: UInt8Array, pose: Pose) -> WallLines:
    """Detect lines on the largest walls of a panorama.

    Parameters
    ----------
    scene : scene that contains the walls.
    image : (H, W, 3) uint8 as in `rectify_chart_from_panorama`.
    pose : stated pose.
    """
    columns_by_wall = [
        _lines_on_wall(scene, chart, image, pose, distance) for chart, distance in _largest_walls(scene, pose)
    ]
    columns = (
        list(zip(*columns_by_wall, strict=True)) if columns_by_wall else [[np.zeros((0, 3))]] * 3 + [[np.zeros(0)]] * 2
    )
    return WallLines(*(np.concatenate(column) for column in columns))


def _largest_walls(scene: Scene, pose: Pose) -> list[tuple[int, float]]:
    """Wall charts by their share of the sphere, largest first, with median distance in metres."""
    rays = panorama_rays(np.array([0.0, 1.0]), WALL_LINES.scan_width)
    distance, chart = scene.caster.cast(camera_position(pose), rays)
    facing = -np.einsum("hwi,hwi->hw", rays, scene.charts.normals()[chart])
    usable = (
        (chart >= 0)
        & (scene.charts.kind[chart] == ChartKind.WALL)
        & (facing > np.sin(np.radians(WALL_LINES.min_facing_deg)))
    )
    usable &= is_in_view(project_directions_to_picture(rays, pose), pose)
    area = np.cos((0.5 - (np.arange(WALL_LINES.scan_width // 2) + 0.5) / (WALL_LINES.scan_width // 2)) * np.pi)[
        :, None
    ] * np.ones((1, WALL_LINES.scan_width))
    share = np.bincount(chart[usable], area[usable], minlength=len(scene.charts)) / area.sum()
    largest = np.argsort(-share, kind="stable")[: WALL_LINES.max_walls]
    return [
        (int(c), float(np.median(distance[usable & (chart == c)])))
        for c in largest.tolist()
        if share[c] >= WALL_LINES.min_wall_share_of_sphere
    ]


def _lines_on_wall(
    scene: Scene, chart: int, image: UInt8Array, pose: Pose, distance: float
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array, Int64Array]:
    """Columns of WallLines for one wall."""
    charts = scene.charts
    extent = charts.size[chart][::-1]
    density = min(
        WALL_LINES.max_pixels_per_metre,
        1.2 * pixels_per_radian(pose, image.shape[1]) / distance,
        WALL_LINES.max_raster_side / extent.max(),
    )
    size = tuple(max(8, round(float(side) * density)) for side in extent)
    # the atlas's density depends on all panoramas, and the pose of one does not
    view = rectify_chart_from_panorama(scene, chart, image, pose, size, extent=charts.size[chart])
    ends = detect_line_segments(view.rgb, view.seen, max(WALL_LINES.min_line_pixels, WALL_LINES.min_line_m * density))
    across, down = np.abs(ends[:, 1] - ends[:, 0]).T
    is_valid = np.minimum(across, down) <= np.tan(np.radians(WALL_LINES.max_axis_angle_deg)) * np.maximum(across, down)
    ends, is_level = ends[is_valid], across[is_valid] > down[is_valid]
    metres = ends * (extent[::-1] / np.array(size[::-1]))
    rays = (
        charts.origin[chart] + metres @ np.stack([charts.axis_u[chart], charts.axis_v[chart]]) - camera_position(pose)
    )
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    plane = np.cross(rays[:, 0], rays[:, 1])
    size_of = np.linalg.norm(plane, axis=1)
    axis = np.where(is_level[:, None], charts.axis_u[chart], charts.axis_v[chart])
    n = len(plane)
    wall = np.broadcast_to(charts.normals()[chart], (n, 3))
    return plane / np.maximum(size_of, 1e-12)[:, None], axis, wall, np.minimum(size_of, 0.3), np.full(n, chart)


def solve_rotation_from_lines(lines: WallLines) -> Float64Array:
    """Solve for the world rotation that aligns lines with their axes.

    Least squares of the angles between axes and planes, reweighted for a Cauchy error that narrows.

    Parameters
    ----------
    lines : lines of one panorama.

    Returns
    -------
    Rotation (3, 3).
    """
    from scipy.spatial.transform import Rotation

    turn = np.eye(3)
    for scale in WALL_LINES.cauchy_scales_deg:
        plane = lines.plane @ turn.T
        angle = np.degrees(np.arcsin(np.clip(np.einsum("ij,ij->i", plane, lines.axis), -1, 1)))
        weight = (lines.weight / WALL_LINES.line_sigma_deg) ** 2 / (1 + (angle / scale) ** 2)
        gradient = np.cross(plane, lines.axis)
        information = (gradient * weight[:, None]).T @ gradient + np.eye(3) / WALL_LINES.prior_sigma_deg**2
        before = np.degrees(Rotation.from_matrix(turn).as_rotvec())
        step = np.linalg.solve(information, -gradient.T @ (weight * angle) - before / WALL_LINES.prior_sigma_deg**2)
        turn = Rotation.from_rotvec(np.radians(step)).as_matrix() @ turn
    return turn


def line_misfit(lines: WallLines, turn: Float64Array) -> float:
    """Compute the weighted mean of the lines' robust error after a rotation, 0 to 1."""
    angle = lines.slopes(turn)
    return float(np.average(angle**2 / (angle**2 + 1.0), weights=lines.weight))


def median_line_angle(lines: WallLines, turn: Float64Array) -> float:
    """Compute the weighted median of the angles in degrees between lines and axes on the rectified walls."""
    angle = np.abs(lines.slopes(turn))
    order = np.argsort(angle)
    share = np.cumsum(lines.weight[order])
    return float(angle[order][np.searchsorted(share, share[-1] / 2)])
