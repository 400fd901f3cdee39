"""A block's plan: made by ingest, kept in the store as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import icechunk
import numpy as np
import shapely

from facade_core.atlas.spec import AtlasSpec
from facade_core.atlas.store import open_table, text_column, write_table
from facade_core.facades import Facades
from facade_core.geometry.charts import KINDS, Charts, Mesh
from facade_core.geometry.packing import Placement
from facade_core.geometry.streets import Viewpoint
from facade_core.plan import Plan, Sightings
from facade_core.street.scene import Scene
from facade_core.types import Building, Pose, Street

if TYPE_CHECKING:
    import xarray as xr

METRES = {"units": "m"}


def write_plan(session: icechunk.Session, plan: Plan, buildings: Sequence[Building], crs: str) -> None:
    """Write the plan's tables. Every group opens in xarray with named dimensions, units and the CRS."""
    import xarray as xr

    scene, charts, placement, facades = plan.scene, plan.scene.charts, plan.scene.placement, plan.facades
    streets, shown, refused = plan.streets, plan.sightings, dict(plan.refused)
    tables: dict[str, xr.Dataset] = {
        "charts": xr.Dataset(
            {
                "kind": ("chart", charts.kind, {"long_name": ", ".join(f"{i} {kind}" for i, kind in enumerate(KINDS))}),
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
                "textured": (
                    "chart",
                    plan.textured,
                    {"long_name": "with a texture of the source's own, or from above"},
                ),
                "id": ("chart", plan.ids, {"long_name": "digest of the chart's kind, place and building"}),
            },
            attrs={"page_size": scene.spec.page, "chunk": scene.spec.chunk, "gutter": scene.spec.gutter},
        ),
        "mesh": xr.Dataset(
            {
                "vertices": (("vertex", "xyz"), scene.mesh.vertices, METRES),
                "triangles": (("triangle", "corner"), scene.mesh.triangles),
                "triangle_chart": ("triangle", scene.mesh.chart),
                "vertex_chart": ("vertex", scene.mesh.vertex_chart),
                **_own_textures(scene.mesh),
            }
        ),
        "sightings": xr.Dataset(
            {
                "facade": ("sighting", shown.facade),
                "panorama": ("sighting", shown.panorama),
                "seen": ("sighting", shown.seen, {"units": "1", "long_name": "share of the facade that it shows"}),
                "pixels_per_metre": ("sighting", shown.pixels_per_metre, {"units": "m-1"}),
            }
        ),
        "poses": xr.Dataset(
            {
                "position": (
                    ("panorama", "xyz"),
                    np.array([[p.x, p.y, p.z] for p in plan.poses]).reshape(-1, 3),
                    METRES,
                ),
                "angles": (
                    ("panorama", "heading_pitch_roll"),
                    np.array([[p.heading, p.pitch, p.roll] for p in plan.poses]).reshape(-1, 3),
                    {"units": "degree", "long_name": "heading clockwise from grid north, pitch up, roll clockwise"},
                ),
                "view": (
                    ("panorama", "left_top_width_height"),
                    np.array([p.view for p in plan.poses]).reshape(-1, 4),
                    {"units": "1", "long_name": "part of the full sphere that the picture holds"},
                ),
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
                "look": ("viewpoint", text_column(plan.looks), {"long_name": "digest of the geometry in sight"}),
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
                "refused": ("building", text_column([refused.get(b.id, "") for b in buildings])),
            }
        ),
    }
    for name, table in tables.items():
        write_table(session, name, table.assign_attrs(crs=crs))


def _own_textures(mesh: Mesh) -> dict[str, Any]:
    """The columns of a mesh with textures of the source's own; a mesh without needs no room for them."""
    if not (mesh.texture >= 0).any():
        return {}
    return {
        "texture": ("triangle", mesh.texture, {"long_name": "picture of the source, -1 none"}),
        "uv": (("triangle", "corner", "uv"), mesh.uv),
    }


def _read_mesh(table: xr.Dataset) -> Mesh:
    triangles = table.triangles.values
    return Mesh(
        vertices=table.vertices.values,
        triangles=triangles,
        chart=table.triangle_chart.values,
        vertex_chart=table.vertex_chart.values,
        texture=table.texture.values if "texture" in table else np.full(len(triangles), -1, np.int32),
        uv=table.uv.values if "uv" in table else np.zeros((len(triangles), 3, 2), np.float32),
    )


def read_plan(session: icechunk.Session, texels_per_metre: float) -> Plan:
    """The plan as `write_plan` wrote it."""
    charts_table = open_table(session, "charts").load()
    mesh = _read_mesh(open_table(session, "mesh").load())
    cameras = open_table(session, "viewpoints").load()
    streets = open_table(session, "streets").load()
    built = open_table(session, "buildings").load()
    poses = open_table(session, "poses").load()
    shown = open_table(session, "sightings").load()

    def columns(table: xr.Dataset, *names: str) -> dict[str, np.ndarray]:
        return {name: table[name].values for name in names}

    charts = Charts(**columns(charts_table, "kind", "surface", "building", "origin", "axis_u", "axis_v", "size"))
    placement = Placement(
        **columns(charts_table, "page", "x", "y", "width", "height"), pages=int(charts_table.page.max()) + 1
    )
    sizes = charts_table.attrs
    spec = AtlasSpec(placement.pages, texels_per_metre, sizes["page_size"], sizes["chunk"], sizes["gutter"])
    scene = Scene(
        mesh,
        charts,
        placement,
        spec,
        spacing=cameras.attrs["spacing"],
        visibility_range=cameras.attrs["visibility_range"],
        names=tuple(map(str, built.id.values)),
    )
    lines = [streets.point.values[streets.point_street.values == i] for i in range(streets.sizes["street"])]
    return Plan(
        scene=scene,
        streets=tuple(
            Street(str(id_), str(name) or None, shapely.LineString(line))
            for id_, name, line in zip(streets.id.values, streets.name.values, lines, strict=True)
        ),
        facades=read_facades(session),
        poses=tuple(
            Pose(x, y, z, heading, pitch, roll, (left, top, width, height))
            for (x, y, z), (heading, pitch, roll), (left, top, width, height) in zip(
                poses.position.values.tolist(), poses.angles.values.tolist(), poses.view.values.tolist(), strict=True
            )
        ),
        refused=tuple((str(i), str(why)) for i, why in zip(built.id.values, built.refused.values, strict=True) if why),
        sightings=Sightings(**columns(shown, "facade", "panorama", "seen", "pixels_per_metre")),
        textured=charts_table.textured.values,
        viewpoints=tuple(
            Viewpoint(i, int(street), position, forward)
            for i, (street, position, forward) in enumerate(
                zip(cameras.street.values, cameras.position.values, cameras.forward.values, strict=True)
            )
        ),
        views=np.column_stack([cameras.view_viewpoint.values, cameras.view_chart.values]),
        writable=charts_table.writable.values,
        wave=streets.wave.values,
        ids=charts_table.id.values,
        looks=tuple(map(str, cameras.look.values)),
    )


def read_facades(session: icechunk.Session) -> Facades:
    table = open_table(session, "facades").load()
    names = ("chart", "street", "building", "width", "height", "floors", "seen")
    return Facades(id=tuple(str(i) for i in table.id.values), **{name: table[name].values for name in names})


def _points(street: Street) -> np.ndarray:
    return shapely.get_coordinates(street.line)
