"""Ray casting against the block's mesh (Open3D's Embree scene)."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np

from facade_core.geometry.charts import Mesh

MISS = -1
# The local origin lies on a grid of this step, metres: the same rays hit the same places when something is built elsewhere.
ORIGIN_M = 1024.0


@cache
def ray_library() -> Any:
    """open3d, loaded."""
    # open3d links against libusb, which many machines lack; the package brings one, loaded before it is looked for.
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d


class RayCaster:
    """Nearest hits of rays with a mesh; not picklable, built once per process and block."""

    def __init__(self, mesh: Mesh) -> None:
        open3d = ray_library()
        # Embree works in float32: a local origin keeps millimetres for coordinates of millions of metres.
        self.centre = np.round(mesh.vertices.mean(axis=0) / ORIGIN_M) * ORIGIN_M
        # behind the last triangle's, what a ray that hits none has met
        self._met = np.append(mesh.chart, MISS).astype(np.int32)
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self._tensor = open3d.core.Tensor
        self._scene.add_triangles(
            self._tensor((mesh.vertices - self.centre).astype(np.float32)),
            self._tensor(mesh.triangles.astype(np.uint32)),
        )

    def cast(self, origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays from `origin` (3,) or (..., 3) along `directions` (..., 3) in world metres.

        Returns the distance in units of the direction's length (...,) float32, inf where nothing is hit, and the chart hit
        (...,) int32, MISS where none.
        """
        rays = np.empty((*directions.shape[:-1], 6), np.float32)
        rays[..., :3] = origin - self.centre
        rays[..., 3:] = directions
        hit = self._scene.cast_rays(self._tensor(rays))
        triangle = hit["primitive_ids"].numpy()
        return hit["t_hit"].numpy(), self._met[np.minimum(triangle, np.uint32(len(self._met) - 1))]
