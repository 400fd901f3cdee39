"""Nearest points on a block's mesh."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.geometry.charts import Mesh
from facade_core.geometry.raycast import load_open3d


class NearestSurface:
    """Search for the nearest points of a mesh; not picklable."""

    def __init__(self, mesh: Mesh) -> None:
        open3d = load_open3d()
        self._tensor = open3d.core.Tensor
        self._chart = mesh.chart
        # Embree works in float32: a local origin keeps millimetres
        self._centre = mesh.vertices.mean(axis=0)
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            self._tensor((mesh.vertices - self._centre).astype(np.float32)),
            self._tensor(mesh.triangles.astype(np.uint32)),
        )

    def find(self, points: Float64Array) -> tuple[Float64Array, Int32Array]:
        """Return the nearest points (n, 3) of the mesh to world points (n, 3), and their charts (n,)."""
        found = self._scene.compute_closest_points(self._tensor((points - self._centre).astype(np.float32)), nthreads=1)
        nearest = found["points"].numpy().astype(np.float64) + self._centre
        return nearest, np.asarray(self._chart[found["primitive_ids"].numpy()], np.int32)
