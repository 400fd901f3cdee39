"""Surroundings in pictures: what stands and lies around a block, before and behind its own surfaces."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, UInt8Array
from facade_core.core.linear_light import linear_to_srgb
from facade_core.core.street_objects import PlacedObjects
from facade_core.core.surrounding_mesh import SurroundingMesh
from facade_core.export.surroundings.colours import surrounding_colours
from facade_core.export.surroundings.models import build_object_model, place_model
from facade_core.geometry.charts import Mesh
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.street.lighting.settings import SKY_LOOK
from facade_core.street.lighting.sky import HORIZON_COLOUR


class SurroundingView:
    """Triangles of the surroundings of a block for rays, with colours of their corners."""

    def __init__(self, placed: PlacedObjects, around: SurroundingMesh) -> None:
        corners = [around.vertices[around.triangles]]
        colours = [surrounding_colours(around)[around.triangles]]
        for kind, variant, rows in placed.rows_by_model():
            model = build_object_model(kind, variant)
            corners.append(place_model(model, placed, kind, rows)[:, model.triangles].reshape(-1, 3, 3))
            colours.append(np.tile(model.colour[model.triangles], (len(rows), 1, 1)))
        self._corners = np.concatenate(corners)
        count, vertices = len(self._corners), self._corners.reshape(-1, 3)
        self._colour = np.concatenate(colours).astype(np.float32)
        index = np.arange(3 * count, dtype=np.int32)
        self._caster = (
            RayCaster(Mesh(vertices, index.reshape(-1, 3), index[:count], np.repeat(index[:count], 3)))
            if count
            else None
        )

    def cover(
        self,
        position: Float64Array,
        rays: Float64Array,
        depth: Float32Array,
        chart: Int32Array,
        rgb: UInt8Array,
    ) -> BoolArray:
        """Draw the surroundings that are nearer than the block, with haze, in place.

        Parameters
        ----------
        position : (3,) of the camera.
        rays : (..., 3) directions.
        depth, chart : (...) of the block's surfaces in these; covered ones become inf and MISS.
        rgb : (..., 3) colours.

        Returns
        -------
        (...) True where the surroundings are drawn.
        """
        if self._caster is None:
            return np.zeros(depth.shape, bool)
        distance, triangle = self._caster.cast(position, rays)
        is_covered: BoolArray = distance < depth
        share = (1 - np.exp(-distance[is_covered] / SKY_LOOK.haze_m))[:, None]
        points = position + rays[is_covered] * distance[is_covered, None]
        colour = self._interpolate(triangle[is_covered], points) * (1 - share) + HORIZON_COLOUR * share
        rgb[is_covered] = np.clip(colour + 0.5, 0, 255).astype(np.uint8)
        depth[is_covered], chart[is_covered] = np.inf, MISS
        return is_covered

    def _interpolate(self, triangle: Int32Array, points: Float64Array) -> UInt8Array:
        """Return the colours (n, 3) at points (n, 3) of triangles (n,)."""
        a, b, c = self._corners[triangle].swapaxes(0, 1)
        normal, apart = np.cross(b - a, c - a), points - a
        area = np.maximum((normal * normal).sum(axis=1), 1e-12)
        share = (
            np.stack([np.cross(apart, c - a), np.cross(b - a, apart)], axis=1) @ normal[..., None] / area[:, None, None]
        )
        share = np.clip(np.concatenate([1 - share.sum(axis=1, keepdims=True), share], axis=1), 0, 1)
        return linear_to_srgb((self._colour[triangle] * share).sum(axis=1))
