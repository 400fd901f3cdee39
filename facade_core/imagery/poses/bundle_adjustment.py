"""Bundle adjustment of panoramas whose points are on known walls, by least squares over rotations and positions.

Panorama i at p_i with rotation R_i (camera to world) has the unknowns m_i, a translation, and w_i, a rotation of the
world. A patch on the wall with normal n through o, seen along the camera ray r, has the position

    x_i = p_i + m_i + s d,    d = exp(w_i) R_i r,    s = n . (o - p_i - m_i) / n . d

and two panoramas agree where x_i = x_j on the wall. The adjustment minimises the sum over all unknowns of

    rho(|x_i - x_j| / match_sigma_m; match_cauchy_scale)          of matches,
    rho(slope / line_sigma_deg; line_cauchy_deg / line_sigma_deg) of lines, each times its length,
    (m_i, w_i)' C_i^-1 (m_i, w_i)                                 of panoramas, C_i the covariance of the prior pose

with Cauchy's rho(e; c) = c^2 log(1 + (e / c)^2). The lines of `wall_lines` are level or upright. A pose stays as close
to its prior as its own evidence requires. The unknowns contain no points: the surfaces are the model's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.poses.settings import ADJUSTMENT, WALL_LINES
from facade_core.imagery.poses.shared_walls import PatchMatches
from facade_core.imagery.poses.wall_lines import WallLines


class BundleAdjustment:
    """Normal equations of n panoramas, their prior poses and their wall lines."""

    def __init__(
        self, scene: Scene, poses: Sequence[Pose], lines: Sequence[WallLines], covariances: Float64Array
    ) -> None:
        """Store the prior poses and their information matrices.

        Parameters
        ----------
        scene : scene that contains the walls.
        poses : n prior poses.
        lines : wall lines of each panorama.
        covariances : (n, 6, 6) of the poses: metres east, north and up, then degrees about these axes.
        """
        self._scene, self._lines, self._prior_information = scene, lines, np.linalg.inv(covariances)
        self._positions = np.array([camera_position(pose) for pose in poses])
        self._to_world = np.array([camera_from_world(pose).T for pose in poses])

    def solve(self, matches: PatchMatches, change: Float64Array) -> Float64Array:
        """Solve for the pose changes by Gauss-Newton, with weights 1 / (1 + (e / c)^2) in each step.

        Parameters
        ----------
        matches : patches that pairs of panoramas show.
        change : (n, 6) initial changes.

        Returns
        -------
        (n, 6) changes: translations in metres, rotations in degrees.
        """
        n = len(self._positions)
        for _ in range(ADJUSTMENT.max_steps):
            normal = np.zeros((n, 6, n, 6))
            right = -np.einsum("nuv,nv->nu", self._prior_information, change)
            index = np.arange(n)
            normal[index, :, index, :] += self._prior_information
            self._add_lines(change, normal, right)
            self._add_matches(matches, change, normal, right)
            step = np.linalg.solve(normal.reshape(6 * n, 6 * n), right.ravel()).reshape(n, 6)
            change = change + step
            if np.abs(step).max() < ADJUSTMENT.converged_step:
                break
        return change

    def match_distances(self, matches: PatchMatches, change: Float64Array) -> Float64Array:
        """Compute the distance (k,) in metres between the two positions of each patch on its wall."""
        distances: Float64Array = np.linalg.norm(
            self._wall_positions(matches, change, 0) - self._wall_positions(matches, change, 1), axis=1
        )
        return distances

    def _wall_positions(self, matches: PatchMatches, change: Float64Array, side: int) -> Float64Array:
        """Positions (k, 2) in metres of patches on their walls, as one side of each pair sees them."""
        from scipy.spatial.transform import Rotation

        charts, camera = self._scene.charts, matches.panorama[:, side]
        normal, origin = charts.normals()[matches.chart], charts.origin[matches.chart]
        turn = Rotation.from_rotvec(np.radians(change[:, 3:])).as_matrix() @ self._to_world
        direction = np.einsum("kij,kj->ki", turn[camera], matches.ray[:, side])
        place = (self._positions + change[:, :3])[camera]
        depth = np.einsum("ki,ki->k", origin - place, normal) / np.einsum("ki,ki->k", direction, normal)
        axes = np.stack([charts.axis_u[matches.chart], charts.axis_v[matches.chart]], axis=1)
        positions: Float64Array = np.einsum("kai,ki->ka", axes, place + depth[:, None] * direction - origin)
        return positions

    def _add_matches(
        self, matches: PatchMatches, change: Float64Array, normal: Float64Array, right: Float64Array
    ) -> None:
        if not len(matches):
            return
        positions = [self._wall_positions(matches, change, side) for side in (0, 1)]
        residual = positions[0] - positions[1]
        slope = np.empty((2, len(matches), 2, 6))  # derivatives of the residual by the unknowns of both panoramas
        for unknown in range(6):
            moved = change.copy()
            moved[:, unknown] += ADJUSTMENT.derivative_step
            for side, sign in ((0, 1.0), (1, -1.0)):
                slope[side, :, :, unknown] = (
                    sign * (self._wall_positions(matches, moved, side) - positions[side]) / ADJUSTMENT.derivative_step
                )
        _, pair, count = np.unique(matches.panorama, axis=0, return_inverse=True, return_counts=True)
        weight = (
            np.minimum(1.0, ADJUSTMENT.max_independent_matches / count[pair.reshape(-1)]) / ADJUSTMENT.match_sigma_m**2
        )
        weight /= 1 + (residual**2).sum(axis=1) / (ADJUSTMENT.match_cauchy_scale * ADJUSTMENT.match_sigma_m) ** 2
        for side in (0, 1):
            np.add.at(right, matches.panorama[:, side], -np.einsum("k,kau,ka->ku", weight, slope[side], residual))
            for other in (0, 1):
                block = np.einsum("k,kau,kav->kuv", weight, slope[side], slope[other])
                np.add.at(normal.transpose(0, 2, 1, 3), (matches.panorama[:, side], matches.panorama[:, other]), block)

    def _add_lines(self, change: Float64Array, normal: Float64Array, right: Float64Array) -> None:
        from scipy.spatial.transform import Rotation

        def slopes(lines: WallLines, turn: Float64Array) -> Float64Array:
            return lines.slopes(Rotation.from_rotvec(np.radians(turn)).as_matrix())

        for number, lines in enumerate(self._lines):
            turn = change[number, 3:]
            residual = slopes(lines, turn)
            slope = np.stack(
                [
                    (slopes(lines, turn + ADJUSTMENT.derivative_step * axis) - residual) / ADJUSTMENT.derivative_step
                    for axis in np.eye(3)
                ],
                axis=1,
            )
            weight = lines.weight / WALL_LINES.line_sigma_deg**2 / (1 + (residual / ADJUSTMENT.line_cauchy_deg) ** 2)
            right[number, 3:] -= (weight * residual) @ slope
            normal[number, 3:, number, 3:] += (slope * weight[:, None]).T @ slope
