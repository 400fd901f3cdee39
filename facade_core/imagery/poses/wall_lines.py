"""The turn of a posed panorama from straight lines on walls: they are level or upright, whatever the camera's place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.panorama_camera import camera_position, is_in_view, project_to_panorama
from facade_core.imagery.rectify.panorama import rectify_view

# Width of the look around that finds the walls, how many are used, and the least share of the sphere of one.
LOOK, MOST_WALLS, LEAST_WALL = 512, 14, 5e-4
# Flatter than this, lines on a wall are too stretched to tell directions.
FACING_DEG = 18.0
# Finest raster of a wall, pixels per metre, and its longest side in pixels.
FINEST, LONGEST = 30.0, 1200
# Shortest line that counts, in pixels and metres, and how far from its axis it may point.
SHORTEST_PX, SHORTEST_M, WIDEST_DEG = 14.0, 0.45, 9.0
# Pixels beside what is not seen whose lines are its outline.
RIM = 4
# Cauchy scales in degrees, one round of reweighting each.
SCALES = (3.0, 2.0, 1.0, 0.6, 0.4, 0.3, 0.3, 0.3)
# Expected error of the given turn in degrees, against that of one line of a radian.
PRIOR_DEG, LINE_DEG = 3.0, 0.15


@dataclass(frozen=True, slots=True, eq=False)
class WallLines:
    """Lines (k,) on walls as a panorama shows them in the world of its given pose: plane (k, 3), unit normals of the planes
    through camera and line; axis (k, 3), the world direction each should have; wall (k, 3), outward normals of their
    walls; weight (k,), angular length in radians, at most 0.3; chart (k,)."""

    plane: np.ndarray
    axis: np.ndarray
    wall: np.ndarray
    weight: np.ndarray
    chart: np.ndarray

    def __len__(self) -> int:
        return len(self.weight)

    def slopes(self, turn: np.ndarray) -> np.ndarray:
        """Angles (k,) in degrees on the rectified walls between lines and axes, after a turn of the world (3, 3)."""
        along = np.cross(self.plane @ turn.T, self.wall)
        return (
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


def detect_wall_lines(scene: Scene, image: np.ndarray, pose: Pose) -> WallLines:
    """The lines on the walls that a panorama shows largest; image (H, W, 3) uint8 as of `rectify_view`."""
    found = [_lines_on(scene, chart, image, pose, distance) for chart, distance in _walls(scene, pose)]
    columns = list(zip(*found, strict=True)) if found else [[np.zeros((0, 3))]] * 3 + [[np.zeros(0)]] * 2
    return WallLines(*(np.concatenate(column) for column in columns))


def _walls(scene: Scene, pose: Pose) -> list[tuple[int, float]]:
    """Charts of walls by the share of the sphere they take, largest first, and their median distance in metres."""
    rays = panorama_rays(np.array([0.0, 1.0]), LOOK)
    distance, chart = scene.caster.cast(camera_position(pose), rays)
    facing = -np.einsum("hwi,hwi->hw", rays, scene.charts.normals()[chart])
    usable = (chart >= 0) & (scene.charts.kind[chart] == ChartKind.WALL) & (facing > np.sin(np.radians(FACING_DEG)))
    usable &= is_in_view(project_to_panorama(rays, pose), pose)
    area = np.cos((0.5 - (np.arange(LOOK // 2) + 0.5) / (LOOK // 2)) * np.pi)[:, None] * np.ones((1, LOOK))
    share = np.bincount(chart[usable], area[usable], minlength=len(scene.charts)) / area.sum()
    largest = np.argsort(-share, kind="stable")[:MOST_WALLS]
    return [
        (int(c), float(np.median(distance[usable & (chart == c)]))) for c in largest.tolist() if share[c] >= LEAST_WALL
    ]


def _lines_on(
    scene: Scene, chart: int, image: np.ndarray, pose: Pose, distance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The columns of Lines for one wall."""
    import cv2

    charts, placement = scene.charts, scene.placement
    extent = np.array([placement.height[chart], placement.width[chart]]) / placement.texels_per_metre[chart]
    density = min(FINEST, 1.2 * image.shape[1] / pose.view[2] / (2 * np.pi) / distance, LONGEST / extent.max())
    size = tuple(max(8, round(float(side) * density)) for side in extent)
    view = rectify_view(scene, chart, image, pose, size)
    grey = cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY)
    segments = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    ends = np.zeros((0, 2, 2)) if segments is None else segments.reshape(-1, 2, 2).astype(np.float64) + 0.5
    within = cv2.erode(view.seen.astype(np.uint8), np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8), borderValue=0)
    across, down = np.abs(ends[:, 1] - ends[:, 0]).T
    length = np.hypot(across, down)
    good = length >= max(SHORTEST_PX, SHORTEST_M * density)
    good &= np.minimum(across, down) <= np.tan(np.radians(WIDEST_DEG)) * np.maximum(across, down)
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        at = np.floor(ends[:, 0] + share * (ends[:, 1] - ends[:, 0])).astype(int)
        good &= within[at[:, 1].clip(0, size[0] - 1), at[:, 0].clip(0, size[1] - 1)] > 0
    ends, level = ends[good], across[good] > down[good]
    metres = ends * (extent[::-1] / np.array(size[::-1]))
    rays = charts.origin[chart] + metres @ np.stack([charts.axis_u[chart], charts.axis_v[chart]]) - camera_position(pose)
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    plane = np.cross(rays[:, 0], rays[:, 1])
    size_of = np.linalg.norm(plane, axis=1)
    axis = np.where(level[:, None], charts.axis_u[chart], charts.axis_v[chart])
    n = len(plane)
    wall = np.broadcast_to(charts.normals()[chart], (n, 3))
    return plane / np.maximum(size_of, 1e-12)[:, None], axis, wall, np.minimum(size_of, 0.3), np.full(n, chart)


def solve_turn(lines: WallLines) -> tuple[np.ndarray, np.ndarray]:
    """The turn of the world (3, 3) that brings lines to their axes, and its information (3, 3) in 1 / degrees squared.

    Least squares of the angles between axes and planes, reweighted for a Cauchy error that narrows.
    """
    from scipy.spatial.transform import Rotation

    turn = np.eye(3)
    information = np.eye(3) / PRIOR_DEG**2
    for scale in SCALES:
        plane = lines.plane @ turn.T
        off = np.degrees(np.arcsin(np.clip(np.einsum("ij,ij->i", plane, lines.axis), -1, 1)))
        weight = (lines.weight / LINE_DEG) ** 2 / (1 + (off / scale) ** 2)
        gradient = np.cross(plane, lines.axis)
        information = (gradient * weight[:, None]).T @ gradient + np.eye(3) / PRIOR_DEG**2
        before = np.degrees(Rotation.from_matrix(turn).as_rotvec())
        step = np.linalg.solve(information, -gradient.T @ (weight * off) - before / PRIOR_DEG**2)
        turn = Rotation.from_rotvec(np.radians(step)).as_matrix() @ turn
    return turn, information


def line_misfit(lines: WallLines, turn: np.ndarray) -> float:
    """Weighted mean of the robust error of the lines after a turn, from 0 to 1: what a better turn makes smaller."""
    off = lines.slopes(turn)
    return float(np.average(off**2 / (off**2 + 1.0), weights=lines.weight))


def median_slope(lines: WallLines, turn: np.ndarray) -> float:
    """Weighted median of the angles in degrees between lines and axes on the rectified walls."""
    off = np.abs(lines.slopes(turn))
    order = np.argsort(off)
    share = np.cumsum(lines.weight[order])
    return float(off[order][np.searchsorted(share, share[-1] / 2)])
