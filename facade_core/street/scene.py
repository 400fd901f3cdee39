"""A block as the street stage sees it: mesh, charts, their place in the atlas and a ray caster."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from facade_core.atlas.spec import AtlasSpec
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.equirectangular import directions
from facade_core.geometry.packing import Placement
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.geometry.streets import Viewpoint


@dataclass(frozen=True)
class Scene:
    """Geometry of a block. `spacing` (metres between viewpoints) and `visibility_range` (metres) gate the views of Eq. 1."""

    mesh: Mesh
    charts: Charts
    placement: Placement
    spec: AtlasSpec
    spacing: float = 5.0
    visibility_range: float = 40.0

    @cached_property
    def caster(self) -> RayCaster:
        return RayCaster(self.mesh)

    def look(self, viewpoint: Viewpoint, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a viewpoint sees: ray directions (h, w, 3), depth (h, w) metres and chart (h, w), MISS beyond the range too."""
        rays = directions(viewpoint.forward, width)
        depth, chart = self.caster.cast(viewpoint.position, rays)
        chart = np.where(depth <= self.visibility_range, chart, MISS)
        return rays, depth, chart

    def seen(self, viewpoint: Viewpoint, width: int) -> np.ndarray:
        """Sorted ids of the charts that the viewpoint's panorama shows: what it reads, and may write."""
        chart = self.look(viewpoint, width)[2]
        return np.unique(chart[chart != MISS])
