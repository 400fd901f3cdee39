"""Ray casting on a block's mesh with Open3D's Embree scene."""

from __future__ import annotations

import ctypes
from functools import cache
from types import ModuleType

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, FloatArray, Int32Array
from facade_core.geometry.charts import Mesh

MISS = -1
# Grid step of the local origin in metres: rays hit the same places when the block changes elsewhere.
ORIGIN_GRID_M = 1024.0


@cache
def load_open3d() -> ModuleType:
    """Import open3d, after the libusb that it needs."""
    # open3d links against libusb, which many machines lack; libusb_package brings one, which must be loaded first
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d


class RayCaster:
    """Ray caster for nearest hits with a mesh; not picklable, built once per process and block."""

    def __init__(self, mesh: Mesh) -> None:
        open3d = load_open3d()
        # Embree works in float32: a local origin keeps millimetres for coordinates of millions of metres.
        self.centre = np.round(mesh.vertices.mean(axis=0) / ORIGIN_GRID_M) * ORIGIN_GRID_M
        # the last entry serves rays without a hit
        self._met = np.append(mesh.chart, MISS).astype(np.int32)
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self._tensor = open3d.core.Tensor
        self._scene.add_triangles(
            self._tensor((mesh.vertices - self.centre).astype(np.float32)),
            self._tensor(mesh.triangles.astype(np.uint32)),
        )

    def cast(self, origin: Float64Array, directions: FloatArray) -> tuple[Float32Array, Int32Array]:
        """Cast rays and return their nearest hits.

        Parameters
        ----------
        origin : (3,) or (..., 3) metres.
        directions : (..., 3) of any length.

        Returns
        -------
        (...) distance in lengths of the direction, inf without a hit; (...) chart, MISS without a hit.
        """
        rays = np.empty((*directions.shape[:-1], 6), np.float32)
        rays[..., :3] = origin - self.centre
        rays[..., 3:] = directions
        hit = self._scene.cast_rays(self._tensor(rays))
        triangle = hit["primitive_ids"].numpy()
        return hit["t_hit"].numpy(), self._met[np.minimum(triangle, np.uint32(len(self._met) - 1))]
