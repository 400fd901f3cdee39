"""A published output, read by columns that all versions' stores have: what old and new code made is measured alike."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import shapely

from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from facade_core.atlas.store import open_root_of_any_format
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.zarr_types import StoreGroup, get_subgroup
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.raycast import RayCaster
from facade_core.geometry.scene import Scene


@dataclass(frozen=True)
class Facade:
    """A facade: its id, chart and building (rows); windows and doors (k, 4): x0, y0, x1, y1 in metres on its chart, y down."""

    id: str
    chart: int
    building: int
    windows: np.ndarray
    doors: np.ndarray


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

    @cached_property
    def items(self) -> pd.DataFrame:
        """The finished facades of items.parquet, by their ids."""
        found = pd.read_parquet(self.snapshot.items)
        return found[(found.kind == "facade") & (found.status == "done")].set_index("id")

    @cached_property
    def buildings(self) -> Mapping[str, np.ndarray]:
        """The columns of the table of buildings."""
        return {name: np.asarray(self.group[f"buildings/{name}"][:]) for name in ("id", "height", "height_source")}

    @cached_property
    def walls(self) -> np.ndarray:
        """The charts (k,) that are walls of buildings."""
        return np.flatnonzero((self.charts.kind == ChartKind.WALL) & (self.charts.building >= 0))

    @cached_property
    def facades(self) -> tuple[Facade, ...]:
        """The facades that are done, with their elements."""
        records = [json.loads(str(text)) if str(text) else {} for text in self.group["journal/facades"][:]]
        charts, buildings = (self.group[f"facades/{name}"][:] for name in ("chart", "building"))
        found = []
        for row, id in enumerate(map(str, self.group["facades/id"][:])):
            if records[row].get("status") == "done":
                chart = int(charts[row])
                boxes = {
                    label: np.array([e[1:5] for e in records[row].get("elements", []) if e[0] == label], float)
                    for label in ("window", "door")
                }
                density = self.placement.texels_per_metre[chart]
                windows, doors = (boxes[label].reshape(-1, 4) / density for label in ("window", "door"))
                found.append(Facade(id, chart, int(buildings[row]), windows, doors))
        return tuple(found)

    def pixels(self, page: int) -> np.ndarray:
        """A page as it was published, (h, w, 3) uint8."""
        from PIL import Image

        with Image.open(self.snapshot.page(page)) as image:
            return np.asarray(image.convert("RGB"))

    def raster(self, pixels: np.ndarray, chart: int) -> np.ndarray:
        """The texels of a chart on the pixels of its page."""
        return pixels[self._place(chart)]

    def labels(self, chart: int) -> np.ndarray:
        """The class ids of a facade, (h, w) uint8."""
        return self.group["facade_maps/labels"][(int(self.placement.page[chart]), *self._place(chart))]

    def exemplar_labels(self) -> dict[str, np.ndarray]:
        """The class ids (h, w) of the exemplars, by their names."""
        records = [json.loads(str(text)) if str(text) else {} for text in self.group["journal/exemplars"][:]]
        done = [(i, one["unit"]) for i, one in enumerate(records) if one.get("status") == "done"]
        return {name: self.group[f"exemplars/{i}/labels"][:] for i, name in done}

    def provenance(self, chart: int) -> np.ndarray:
        """What its texels are from, (h, w) uint8: an index into the store's own list of sources."""
        return self.group["atlas/provenance"][(int(self.placement.page[chart]), *self._place(chart))]

    def _place(self, chart: int) -> tuple[slice, slice]:
        """The rows and columns of a chart on its page."""
        place = self.placement
        y, x = int(place.y[chart]), int(place.x[chart])
        return slice(y, y + int(place.height[chart])), slice(x, x + int(place.width[chart]))

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """The names of what texels can be from."""
        return tuple(str(self.group["atlas/provenance"].attrs["flag_meanings"]).split())


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


def facade_items(output: Output) -> list[tuple[Facade, Any]]:
    """Facades with their rows of the catalogue."""
    return [(facade, output.items.loc[facade.id]) for facade in output.facades if facade.id in output.items.index]
