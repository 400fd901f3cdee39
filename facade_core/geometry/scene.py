"""Scene of a block for visibility: mesh, charts, their places in the atlas, and a ray caster."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, FloatArray, Int32Array, Int64Array, IntArray
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.name_hash import hash_name
from facade_core.core.numba_cache import njit
from facade_core.core.types import BuildingFinish
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.daylight import ChartDaylight
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.geometry.streets import Viewpoint


@dataclass(frozen=True)
class Scene:
    """Geometry of a block.

    Attributes
    ----------
    mesh, charts, placement, spec : geometry and atlas.
    spacing : metres between viewpoints; gates the views of Eq. 1.
    visibility_range : metres; gates the views of Eq. 1.
    names : ids of the buildings by row.
    finishes : stated colours and materials by row; empty where none are stated.
    """

    mesh: Mesh
    charts: Charts
    placement: ChartPlacements
    spec: AtlasSpec
    spacing: float = 5.0
    visibility_range: float = 40.0
    names: tuple[str, ...] = ()
    finishes: tuple[BuildingFinish, ...] = ()

    def __reduce__(self) -> tuple[type[Scene], tuple[object, ...]]:
        """Pickle the fields only, without derived values such as the ray caster."""
        return Scene, tuple(getattr(self, one.name) for one in fields(self))

    @cached_property
    def building_hashes(self) -> Int64Array:
        """Return a 32-bit hash of each building's id as a random seed, (buildings,); the row in a scene without names."""
        if not self.names:
            return np.arange(max(1, int(self.charts.building.max(initial=0)) + 1))
        return np.array([hash_name(name) for name in self.names])

    @cached_property
    def caster(self) -> RayCaster:
        """Return the ray caster of the mesh."""
        return RayCaster(self.mesh)

    @cached_property
    def daylight(self) -> ChartDaylight:
        """Return the daylight of the charts."""
        return ChartDaylight(self.charts, self.caster)

    def with_density(self, texels_per_metre: float) -> Scene:
        """Return the scene with no more texels per metre on any chart; the ray caster and the daylight are shared.

        Its charts have no place on pages.
        """
        placement = self.placement
        density = np.minimum(placement.texels_per_metre, texels_per_metre)
        width, height = self.charts.texels(density).astype(np.int32).T
        coarse = replace(placement, width=width, height=height, texels_per_metre=density)
        changed = replace(self, placement=coarse)
        vars(changed).update(caster=self.caster, daylight=self.daylight)
        return changed

    def cast_panorama(self, viewpoint: Viewpoint, width: int) -> tuple[Float64Array, Float32Array, Int32Array]:
        """Cast the rays of a viewpoint's panorama.

        Parameters
        ----------
        viewpoint : the camera.
        width : pixels; the height is half of it.

        Returns
        -------
        (h, w, 3) ray directions, (h, w) depth in metres, and (h, w) chart, MISS beyond the visibility range too.
        """
        rays = panorama_rays(viewpoint.forward, width)
        depth, chart = self.caster.cast(viewpoint.position, rays)
        chart = np.where(depth <= self.visibility_range, chart, MISS)
        return rays, depth, chart

    def locate_texels(self, points: Float64Array, chart: IntArray) -> tuple[Int32Array, Int32Array]:
        """Return the texels that hold world points on their charts.

        Parameters
        ----------
        points : (k, 3) metres.
        chart : (k,) chart of each point.

        Returns
        -------
        (k,) row and (k,) column, clipped to the chart.
        """
        charts, placement = self.charts, self.placement
        row, column = np.empty(len(chart), np.int32), np.empty(len(chart), np.int32)
        frame = (charts.origin, charts.axis_u, charts.axis_v, placement.width, placement.height)
        _locate(points, chart, *frame, placement.texels_per_metre, row, column)
        return row, column

    def visible_charts(self, viewpoint: Viewpoint, width: int) -> Int32Array:
        """Return the ascending ids of the charts in the viewpoint's panorama."""
        chart = self.cast_panorama(viewpoint, width)[2]
        return np.unique(chart[chart != MISS])


@njit(cache=True, nogil=True)
def _locate(
    points: Float64Array,
    chart: IntArray,
    origin: Float64Array,
    axis_u: Float64Array,
    axis_v: Float64Array,
    width: IntArray,
    height: IntArray,
    density: FloatArray,
    row: Int32Array,
    column: Int32Array,
) -> None:
    for k in range(len(chart)):
        c = chart[k]
        x, y = 0.0, 0.0
        for i in range(3):
            offset = points[k, i] - origin[c, i]
            x += offset * axis_u[c, i]
            y += offset * axis_v[c, i]
        column[k] = min(max(int(x * density[c]), 0), width[c] - 1)
        row[k] = min(max(int(y * density[c]), 0), height[c] - 1)
