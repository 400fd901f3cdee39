"""Bundle adjustment of panoramas whose points lie on known walls: turns and places by least squares.

Of panorama i at p_i with the turn R_i (camera to world), unknown are a move m_i and a turn w_i of the world. A patch on the
wall with normal n through o, seen along the ray r of the camera's axes, lies at

    x_i = p_i + m_i + s d,    d = exp(w_i) R_i r,    s = n . (o - p_i - m_i) / n . d

and two panoramas agree where x_i = x_j on the wall. Minimised is, over all unknowns, the sum of

    rho(|x_i - x_j| / MATCH_M; MATCH_SCALE)            of matches,
    rho(slope / LINE_DEG; LINE_SCALE_DEG / LINE_DEG)   of lines, each times its length,
    (m_i, w_i)' C_i^-1 (m_i, w_i)                      of panoramas, C_i the covariance of the pose as it was

with Cauchy's rho(e; c) = c^2 log(1 + (e / c)^2): the lines of `detect_wall_lines` are level or upright, and a pose stays where it was
as closely as its own evidence told it. There are no points among the unknowns: the surfaces are the model's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.poses.shared_walls import PatchMatches
from facade_core.imagery.poses.wall_lines import LINE_DEG, WallLines

# Expected error of a match, metres, and from how many of them on it counts less; scale of lines, degrees.
MATCH_M, MATCH_SCALE, LINE_SCALE_DEG = 0.05, 3.0, 0.5
# So many matches of a pair count as independent of each other.
INDEPENDENT = 40
# Steps at most, and that of a metre or a degree below which they end; steps of the derivatives likewise.
STEPS, DONE, APART = 40, 1e-5, 1e-4


class BundleAdjustment:
    """The equations of some panoramas, of their given poses (n), and their lines."""

    def __init__(self, scene: Scene, poses: Sequence[Pose], lines: Sequence[WallLines], covariances: np.ndarray) -> None:
        """expected (n, 6, 6): covariances of the poses east, north and up, metres, and about these axes, degrees."""
        self._scene, self._lines, self._held = scene, lines, np.linalg.inv(covariances)
        self._place = np.array([camera_position(pose) for pose in poses])
        self._to_world = np.array([camera_from_world(pose).T for pose in poses])

    def solve(self, matches: PatchMatches, change: np.ndarray) -> np.ndarray:
        """The changes (n, 6) of the poses that matches ask for, from some on: moves, metres, and turns, degrees.

        Gauss-Newton, each step's weights 1 / (1 + (e / c)^2).
        """
        n = len(self._place)
        for _ in range(STEPS):
            normal = np.zeros((n, 6, n, 6))
            right = -np.einsum("nuv,nv->nu", self._held, change)
            at = np.arange(n)
            normal[at, :, at, :] += self._held
            self._add_lines(change, normal, right)
            self._add_matches(matches, change, normal, right)
            step = np.linalg.solve(normal.reshape(6 * n, 6 * n), right.ravel()).reshape(n, 6)
            change = change + step
            if np.abs(step).max() < DONE:
                break
        return change

    def match_distances(self, matches: PatchMatches, change: np.ndarray) -> np.ndarray:
        """How far from each other two panoramas have each patch on its wall, metres (k,)."""
        return np.linalg.norm(self._wall_positions(matches, change, 0) - self._wall_positions(matches, change, 1), axis=1)

    def _wall_positions(self, matches: PatchMatches, change: np.ndarray, side: int) -> np.ndarray:
        """Where one of both panoramas has patches on their walls, metres (k, 2)."""
        from scipy.spatial.transform import Rotation

        charts, camera = self._scene.charts, matches.panorama[:, side]
        normal, origin = charts.normals()[matches.chart], charts.origin[matches.chart]
        turn = Rotation.from_rotvec(np.radians(change[:, 3:])).as_matrix() @ self._to_world
        way = np.einsum("kij,kj->ki", turn[camera], matches.ray[:, side])
        at = (self._place + change[:, :3])[camera]
        far = np.einsum("ki,ki->k", origin - at, normal) / np.einsum("ki,ki->k", way, normal)
        axes = np.stack([charts.axis_u[matches.chart], charts.axis_v[matches.chart]], axis=1)
        return np.einsum("kai,ki->ka", axes, at + far[:, None] * way - origin)

    def _add_matches(self, matches: PatchMatches, change: np.ndarray, normal: np.ndarray, right: np.ndarray) -> None:
        if not len(matches):
            return
        lies = [self._wall_positions(matches, change, side) for side in (0, 1)]
        off = lies[0] - lies[1]
        slope = np.empty((2, len(matches), 2, 6))  # of what lies apart, by the unknowns of either panorama
        for unknown in range(6):
            moved = change.copy()
            moved[:, unknown] += APART
            for side, sign in ((0, 1.0), (1, -1.0)):
                slope[side, :, :, unknown] = sign * (self._wall_positions(matches, moved, side) - lies[side]) / APART
        _, pair, count = np.unique(matches.panorama, axis=0, return_inverse=True, return_counts=True)
        weight = np.minimum(1.0, INDEPENDENT / count[pair.reshape(-1)]) / MATCH_M**2
        weight /= 1 + (off**2).sum(axis=1) / (MATCH_SCALE * MATCH_M) ** 2
        for side in (0, 1):
            np.add.at(right, matches.panorama[:, side], -np.einsum("k,kau,ka->ku", weight, slope[side], off))
            for other in (0, 1):
                block = np.einsum("k,kau,kav->kuv", weight, slope[side], slope[other])
                np.add.at(normal.transpose(0, 2, 1, 3), (matches.panorama[:, side], matches.panorama[:, other]), block)

    def _add_lines(self, change: np.ndarray, normal: np.ndarray, right: np.ndarray) -> None:
        from scipy.spatial.transform import Rotation

        def slopes(lines: WallLines, turn: np.ndarray) -> np.ndarray:
            return lines.slopes(Rotation.from_rotvec(np.radians(turn)).as_matrix())

        for number, lines in enumerate(self._lines):
            turn = change[number, 3:]
            off = slopes(lines, turn)
            slope = np.stack([(slopes(lines, turn + APART * axis) - off) / APART for axis in np.eye(3)], axis=1)
            weight = lines.weight / LINE_DEG**2 / (1 + (off / LINE_SCALE_DEG) ** 2)
            right[number, 3:] -= (weight * off) @ slope
            normal[number, 3:, number, 3:] += (slope * weight[:, None]).T @ slope
