"""Ray parity test for the inside of a shell."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.geometry.raycast import load_open3d
from facade_core.geometry.settings import CROSSINGS

# Offsets of the three rays of a point, so that no ray hits an edge of an upright world exactly.
RAY_TILTS = np.array([[0.0123, 0.0071, 0.0047], [-0.0087, 0.0131, 0.0059], [0.0031, -0.0149, 0.0083]])


class RayCrossingCounter:
    """Counter of ray crossings with the triangles (t, 3, 3) of a shell; not picklable."""

    def __init__(self, corners: Float64Array, facet: Int64Array) -> None:
        self._facet = facet
        self._centre = corners.reshape(-1, 3).mean(axis=0) if len(corners) else np.zeros(3)
        open3d = load_open3d()
        self._tensor = open3d.core.Tensor
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        if len(corners):
            self._scene.add_triangles(
                self._tensor((corners.reshape(-1, 3) - self._centre).astype(np.float32)),
                self._tensor(np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)),
            )

    def has_odd_crossings(self, points: Float64Array, directions: Float64Array, own: Int64Array) -> BoolArray:
        """Return whether most of three rays from each point cross an odd number of triangles.

        Parameters
        ----------
        points : (n, 3) metres.
        directions : (n, 3).
        own : (n,) facet whose triangles do not count.

        Returns
        -------
        (n,).
        """
        if len(points) == 0 or len(self._facet) == 0:
            return np.zeros(len(points), bool)
        rays = np.empty((len(RAY_TILTS), len(points), 6), np.float32)
        rays[..., :3] = points - self._centre
        rays[..., 3:] = directions + RAY_TILTS[:, None]
        hit = {
            name: of.numpy() for name, of in self._scene.list_intersections(self._tensor(rays.reshape(-1, 6))).items()
        }
        ray = hit["ray_ids"].astype(np.int64)
        counted = (self._facet[hit["primitive_ids"]] != own[ray % len(points)]) & (hit["t_hit"] > CROSSINGS.min_hit_m)
        crossed = np.bincount(ray[counted], minlength=rays[..., 0].size).reshape(len(RAY_TILTS), len(points))
        is_majority_odd: BoolArray = (crossed % 2).sum(axis=0) > len(RAY_TILTS) // 2
        return is_majority_odd
