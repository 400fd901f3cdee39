"""A block's plan: made by ingest, kept in the store as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import icechunk
import numpy as np
import shapely

from catalogs.block import Block
from facade_core.atlas.spec import AtlasSpec
from facade_core.atlas.store import open_table, text_column, write_table
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.packing import Placement
from facade_core.geometry.streets import Viewpoint
from facade_core.ingest import Facades, Plan, ingest
from facade_core.street.scene import Scene
from facade_core.types import Building, Street

if TYPE_CHECKING:
    import xarray as xr

METRES = {"units": "m"}


def plan_of(block: Block) -> Plan:
    """Ingest a block as its settings say."""
    texture = block.texture
    return ingest(
        block.buildings,
        block.streets,
        texels_per_metre=texture.texels_per_metre,
        spacing=texture.viewpoint_spacing,
        height=texture.viewpoint_height,
        visibility_range=texture.visibility_range,
        panorama_width=texture.panorama_width,
        storey=block.storey,
        walls=texture.walls,
    )


def write_plan(
    session: icechunk.Session, plan: Plan, buildings: Sequence[Building], streets: Sequence[Street], crs: str
) -> None:
    """Write the plan's tables. Every group opens in xarray with named dimensions, units and the CRS."""
    import xarray as xr

    scene, charts, placement, facades = plan.scene, plan.scene.charts, plan.scene.placement, plan.facades
    tables: dict[str, xr.Dataset] = {
        "charts": xr.Dataset(
            {
                "kind": ("chart", charts.kind, {"long_name": "0 wall, 1 roof, 2 ground"}),
                "surface": ("chart", charts.surface),
                "building": ("chart", charts.building, {"long_name": "row of buildings, -1 for ground"}),
                "origin": (("chart", "xyz"), charts.origin, METRES),
                "axis_u": (("chart", "xyz"), charts.axis_u),
                "axis_v": (("chart", "xyz"), charts.axis_v),
                "size": (("chart", "width_height"), charts.size, METRES),
                "page": ("chart", placement.page),
                "x": ("chart", placement.x, {"units": "texel"}),
                "y": ("chart", placement.y, {"units": "texel"}),
                "width": ("chart", placement.width, {"units": "texel"}),
                "height": ("chart", placement.height, {"units": "texel"}),
                "writable": ("chart", plan.writable, {"long_name": "written by the street stage"}),
            },
            attrs={"page_size": scene.spec.page, "chunk": scene.spec.chunk, "gutter": scene.spec.gutter},
        ),
        "mesh": xr.Dataset(
            {
                "vertices": (("vertex", "xyz"), scene.mesh.vertices, METRES),
                "triangles": (("triangle", "corner"), scene.mesh.triangles),
                "triangle_chart": ("triangle", scene.mesh.chart),
                "vertex_chart": ("vertex", scene.mesh.vertex_chart),
            }
        ),
        "facades": xr.Dataset(
            {
                "id": ("facade", text_column(facades.id)),
                "chart": ("facade", facades.chart),
                "street": ("facade", facades.street),
                "building": ("facade", facades.building),
                "width": ("facade", facades.width, METRES),
                "height": ("facade", facades.height, METRES),
                "floors": ("facade", facades.floors),
                "seen": ("facade", facades.seen, {"units": "1", "long_name": "share seen from its street"}),
            }
        ),
        "viewpoints": xr.Dataset(
            {
                "street": ("viewpoint", np.array([v.street for v in plan.viewpoints], np.int32)),
                "position": (
                    ("viewpoint", "xyz"),
                    np.array([v.position for v in plan.viewpoints]).reshape(-1, 3),
                    METRES,
                ),
                "forward": (("viewpoint", "xy"), np.array([v.forward for v in plan.viewpoints]).reshape(-1, 2)),
                "view_viewpoint": ("view", plan.views[:, 0]),
                "view_chart": ("view", plan.views[:, 1]),
            },
            attrs={"spacing": scene.spacing, "visibility_range": scene.visibility_range},
        ),
        "streets": xr.Dataset(
            {
                "id": ("street", text_column([s.id for s in streets])),
                "name": ("street", text_column([s.name or "" for s in streets])),
                "wave": ("street", plan.wave),
                "point": (
                    ("vertex", "xy"),
                    np.concatenate([_points(s) for s in streets] or [np.empty((0, 2))]),
                    METRES,
                ),
                "point_street": ("vertex", np.repeat(np.arange(len(streets)), [len(_points(s)) for s in streets])),
            }
        ),
        "buildings": xr.Dataset(
            {
                "id": ("building", text_column([b.id for b in buildings])),
                "name": ("building", text_column([b.name or "" for b in buildings])),
                "height": ("building", np.array([b.height for b in buildings]), METRES),
                "height_source": ("building", text_column([b.height_source for b in buildings])),
                "levels": ("building", np.array([b.levels or 0 for b in buildings], np.int32)),
            }
        ),
    }
    for name, table in tables.items():
        write_table(session, name, table.assign_attrs(crs=crs))


def read_plan(session: icechunk.Session, texels_per_metre: float) -> tuple[Plan, tuple[Street, ...]]:
    """The plan and the streets as `write_plan` wrote them."""
    charts_table = open_table(session, "charts").load()
    mesh = open_table(session, "mesh").load()
    cameras = open_table(session, "viewpoints").load()
    streets = open_table(session, "streets").load()

    def columns(table: xr.Dataset, *names: str) -> dict[str, np.ndarray]:
        return {name: table[name].values for name in names}

    charts = Charts(**columns(charts_table, "kind", "surface", "building", "origin", "axis_u", "axis_v", "size"))
    placement = Placement(
        **columns(charts_table, "page", "x", "y", "width", "height"), pages=int(charts_table.page.max()) + 1
    )
    sizes = charts_table.attrs
    spec = AtlasSpec(placement.pages, texels_per_metre, sizes["page_size"], sizes["chunk"], sizes["gutter"])
    scene = Scene(
        Mesh(mesh.vertices.values, mesh.triangles.values, mesh.triangle_chart.values, mesh.vertex_chart.values),
        charts,
        placement,
        spec,
        spacing=cameras.attrs["spacing"],
        visibility_range=cameras.attrs["visibility_range"],
    )
    plan = Plan(
        scene=scene,
        facades=read_facades(session),
        viewpoints=tuple(
            Viewpoint(i, int(street), position, forward)
            for i, (street, position, forward) in enumerate(
                zip(cameras.street.values, cameras.position.values, cameras.forward.values, strict=True)
            )
        ),
        views=np.column_stack([cameras.view_viewpoint.values, cameras.view_chart.values]),
        writable=charts_table.writable.values,
        wave=streets.wave.values,
    )
    lines = [streets.point.values[streets.point_street.values == i] for i in range(streets.sizes["street"])]
    return plan, tuple(
        Street(str(id_), str(name) or None, shapely.LineString(line))
        for id_, name, line in zip(streets.id.values, streets.name.values, lines, strict=True)
    )


def read_facades(session: icechunk.Session) -> Facades:
    table = open_table(session, "facades").load()
    names = ("chart", "street", "building", "width", "height", "floors", "seen")
    return Facades(id=tuple(str(i) for i in table.id.values), **{name: table[name].values for name in names})


def _points(street: Street) -> np.ndarray:
    return shapely.get_coordinates(street.line)
