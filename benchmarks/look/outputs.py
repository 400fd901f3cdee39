"""A published output, read by columns that all versions' stores have: what old and new code made is measured alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely

from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from facade_core.atlas.store import open_root_of_any_format
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.zarr_types import StoreGroup, get_subgroup
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.raycast import RayCaster
from facade_core.geometry.scene import Scene


@dataclass(frozen=True)
class Output:
    """What a run published: geometry, places of charts on pages, pages, and the items of the catalogue."""

    snapshot: SnapshotFolder[Path]
    group: StoreGroup
    charts: Charts
    mesh: Mesh
    placement: ChartPlacements
    streets: tuple[shapely.LineString, ...]

    @property
    def name(self) -> str:
        return str(self.snapshot.out)

    @cached_property
    def scene(self) -> Scene:
        """The geometry, for what casts rays and draws."""
        page, chunk, gutter = (
            get_subgroup(self.group, "charts").attrs[name] for name in ("page_size", "chunk", "gutter")
        )
        whole = float(get_subgroup(self.group, "atlas").attrs["texels_per_metre"])
        spec = AtlasSpec(self.placement.pages, whole, page, chunk, gutter)
        return Scene(self.mesh, self.charts, self.placement, spec)

    @property
    def caster(self) -> RayCaster:
        return self.scene.caster

    def pixels(self, page: int) -> np.ndarray:
        """A page as it was published, (h, w, 3) uint8."""
        from PIL import Image

        with Image.open(self.snapshot.page(page)) as image:
            return np.asarray(image.convert("RGB"))

    def raster(self, pixels: np.ndarray, chart: int) -> np.ndarray:
        """The texels of a chart on the pixels of its page."""
        return pixels[self._place(chart)]

    def _place(self, chart: int) -> tuple[slice, slice]:
        """The rows and columns of a chart on its page."""
        place = self.placement
        y, x = int(place.y[chart]), int(place.x[chart])
        return slice(y, y + int(place.height[chart])), slice(x, x + int(place.width[chart]))


def read_output(out: Path) -> Output:
    """What the run in a folder published last. Raises InputError or StoreError where there is none that can be read."""
    snapshot = current_snapshot(out)
    group = open_root_of_any_format(snapshot.open_session())
    column = {name: array[:] for name, array in get_subgroup(group, "charts").arrays()}
    kind, surface, building, *frame = (
        column[name] for name in ("kind", "surface", "building", "origin", "axis_u", "axis_v", "size")
    )
    vertices, triangles, chart, vertex_chart = (
        group[f"mesh/{name}"][:] for name in ("vertices", "triangles", "triangle_chart", "vertex_chart")
    )
    page, x, y, width, height = (column[name] for name in ("page", "x", "y", "width", "height"))
    whole = float(get_subgroup(group, "atlas").attrs["texels_per_metre"])
    points, of = group["streets/point"][:], group["streets/point_street"][:]
    return Output(
        snapshot,
        group,
        Charts(kind, surface, building, *frame),
        Mesh(vertices, triangles, chart, vertex_chart),
        ChartPlacements(
            page, x, y, width, height, column.get("texels_per_metre", np.full(len(page), whole)), int(page.max()) + 1
        ),
        tuple(shapely.LineString(points[of == street]) for street in np.unique(of)),
    )
