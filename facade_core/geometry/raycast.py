"""Ray casting on a block's mesh with an Embree scene."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from facade_core.core.arrays import Float32Array, Float64Array, FloatArray, Int32Array
from facade_core.geometry.charts import Mesh

MISS = -1
# Grid step of the local origin in metres: rays hit the same places when the block changes elsewhere.
ORIGIN_GRID_M = 1024.0


class RayCaster:
    """Ray caster for nearest hits with a mesh; not picklable, built once per process and block."""

    def __init__(self, mesh: Mesh) -> None:
        # Embree works in float32: a local origin keeps millimetres for coordinates of millions of metres.
        self.centre = np.round(mesh.vertices.mean(axis=0) / ORIGIN_GRID_M) * ORIGIN_GRID_M
        # the last entry serves rays without a hit
        self._met = np.append(mesh.chart, MISS).astype(np.int32)
        self._scene = EmbreeScene(robust=True)  # no ray passes between triangles that share an edge
        TriangleMesh(
            self._scene, (mesh.vertices - self.centre).astype(np.float32), np.asarray(mesh.triangles, np.int32)
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
        shape = directions.shape[:-1]
        starts = np.empty((*shape, 3), np.float32)
        starts[...] = origin - self.centre
        ahead = np.ascontiguousarray(directions, np.float32)
        hit = self._scene.run(starts.reshape(-1, 3), ahead.reshape(-1, 3), output=True)
        triangle = hit["primID"].reshape(shape)  # -1 without a hit, which is the last entry too
        distance = np.where(triangle < 0, np.float32(np.inf), hit["tfar"].reshape(shape))
        return distance, self._met[triangle]
