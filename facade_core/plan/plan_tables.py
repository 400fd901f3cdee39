"""Tables of a plan in the store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TypeVar

import icechunk
import numpy as np
import shapely

from facade_core.atlas.store import open_root, open_table, write_table
from facade_core.atlas.table_schema import TABLES, TableValues
from facade_core.core.arrays import Float64Array
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.lens_projection import LENS_VALUES, lens_from_values, lens_values
from facade_core.core.street_objects import NO_OBJECTS, OBJECT_KIND_NAMES, PlacedObjects
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS, SurroundingMesh
from facade_core.core.types import Building, BuildingFinish, GroundArea, GroundWay, MappedGround, Pose, Street
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.facades import Facades
from facade_core.plan.plan import FacadeSightings, Plan

T = TypeVar("T", Charts, Facades, ChartPlacements, FacadeSightings, PlacedObjects, SurroundingMesh)


def write_plan(session: icechunk.Session, plan: Plan, buildings: Sequence[Building], crs: str) -> None:
    """Write the tables of a plan. Every group opens in xarray with named dimensions, units and the CRS.

    Parameters
    ----------
    session : writable session of the store.
    buildings : all buildings of the block.
    crs : projected CRS of the block.
    """
    for name, values in _plan_values(plan, buildings).items():
        table = TABLES[name]
        attributes = {key: values.pop(key) for key in table.attributes}
        write_table(session, name, table.to_dataset(values, attributes, crs))


def read_plan(session: icechunk.Session) -> Plan:
    """Read the plan, with the density of the atlas."""
    density = float(open_root(session)["atlas"].attrs["texels_per_metre"])
    return _plan_from_tables({name: read_table(session, name) for name in list_tables(session)}, density)


def list_tables(session: icechunk.Session) -> list[str]:
    """List the tables of a plan: all of TABLES but optional ones that it lacks."""
    root = open_root(session)
    return [name for name, table in TABLES.items() if name in root or not table.is_optional]


def read_facades(session: icechunk.Session) -> Facades:
    """Read the facades of the plan."""
    return _facades_from_table(read_table(session, "facades"))


def read_table(session: icechunk.Session, name: str) -> TableValues:
    """Read the columns (rows, ...) and attributes of one of TABLES; strings as str."""
    return TABLES[name].read_columns(open_table(session, name).load())


def placement_from_table(charts: TableValues) -> ChartPlacements:
    """Return the placement in a table of charts."""
    return _from_columns(ChartPlacements, {**charts, "pages": int(charts["page"].max(initial=-1)) + 1})


def _facades_from_table(values: TableValues) -> Facades:
    return _from_columns(Facades, values)


def _from_columns(kind: type[T], values: TableValues) -> T:
    """Construct a dataclass from the columns of its field names."""
    return kind(**{field.name: values[field.name] for field in fields(kind)})


def _columns(
    value: Charts | Facades | ChartPlacements | FacadeSightings | PlacedObjects | SurroundingMesh,
) -> dict[str, object]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _plan_values(plan: Plan, buildings: Sequence[Building]) -> dict[str, dict[str, object]]:
    """Return the plan as tables."""
    scene, streets = plan.scene, plan.streets
    placement = _columns(scene.placement)
    del placement["pages"]
    return {
        "charts": {
            **_columns(scene.charts),
            **placement,
            "writable": plan.writable,
            "textured": plan.textured,
            "own": plan.in_core,
            "id": plan.ids,
            **_street_density_column(plan),
            "page_size": scene.spec.page,
            "chunk": scene.spec.chunk,
            "gutter": scene.spec.gutter,
        },
        "mesh": {
            "vertices": scene.mesh.vertices,
            "triangles": scene.mesh.triangles,
            "triangle_chart": scene.mesh.chart,
            "vertex_chart": scene.mesh.vertex_chart,
            **_model_textures(scene.mesh),
        },
        "sightings": _columns(plan.sightings),
        **_camera_tables(plan),
        "streets": {
            "id": [s.id for s in streets],
            "name": _texts(streets, "name"),
            "point": np.concatenate([_street_points(s) for s in streets] or [np.empty((0, 2))]),
            "point_street": np.repeat(np.arange(len(streets)), [len(_street_points(s)) for s in streets]),
        },
        **_ground_tables(plan),
        "objects": _columns(plan.objects) | {"kind": [OBJECT_KIND_NAMES[kind] for kind in plan.objects.kind]},
        "surroundings": _columns(plan.surroundings),
        "buildings": _building_table(buildings, dict(plan.rejected_buildings)),
    }


def _attributes(items: Sequence[object], *names: str) -> dict[str, object]:
    """Return columns of attributes of items."""
    return {name: [getattr(item, name) for item in items] for name in names}


def _texts(items: Sequence[object], name: str) -> list[str]:
    """Return an attribute of items as texts, empty where it is None."""
    return [getattr(item, name) or "" for item in items]


def _camera_tables(plan: Plan) -> dict[str, dict[str, object]]:
    """Return the tables of the poses, of the facades and of the viewpoints."""
    return {
        "poses": {
            "position": np.array([[p.x, p.y, p.z] for p in plan.poses]).reshape(-1, 3),
            "angles": np.array([[p.heading, p.pitch, p.roll] for p in plan.poses]).reshape(-1, 3),
            "view": np.array([p.view for p in plan.poses]).reshape(-1, 4),
            **_lens_columns(plan.poses),
        },
        "facades": _columns(plan.facades),
        "viewpoints": {
            "street": [v.street for v in plan.viewpoints],
            "position": np.array([v.position for v in plan.viewpoints]).reshape(-1, 3),
            "forward": np.array([v.forward for v in plan.viewpoints]).reshape(-1, 2),
            "look": plan.view_digests,
            "view_viewpoint": plan.views[:, 0],
            "view_chart": plan.views[:, 1],
            "spacing": plan.scene.spacing,
            "visibility_range": plan.scene.visibility_range,
        },
    }


def _ground_tables(plan: Plan) -> dict[str, dict[str, object]]:
    """Return the tables of the ways and of the areas."""
    ways, areas, outline = plan.ground.ways, plan.ground.areas, plan.ground.outline
    return {
        "ways": {
            **_attributes(ways, "id", "kind"),
            "line": [shapely.to_wkb(w.line, hex=True) for w in ways],
            **_attributes(ways, "width", "assumed", "surface", "lanes", "oneway"),
            "pavement": np.array([w.pavement for w in ways]).reshape(-1, 2),
            "parking": np.array([w.parking for w in ways]).reshape(-1, 2),
            **_attributes(ways, "rank"),
        },
        "areas": {
            **_attributes(areas, "id"),
            "outline": [shapely.to_wkb(a.outline, hex=True) for a in areas],
            **_attributes(areas, "surface"),
            "block": shapely.to_wkb(outline, hex=True) if outline is not None else "",
        },
    }


def _building_table(buildings: Sequence[Building], refused: Mapping[str, str]) -> dict[str, object]:
    """Return the table of the buildings; `refused` holds the reasons by the ids of those without surfaces."""
    finishes = [b.finish for b in buildings]
    return {
        **_attributes(buildings, "id"),
        "name": _texts(buildings, "name"),
        **_attributes(buildings, "height", "height_source"),
        "levels": [b.levels or 0 for b in buildings],
        **_attributes(buildings, "raised"),
        "part_of": _texts(buildings, "part_of"),
        **_roof_columns(buildings),
        "wall_colour": [_format_colour(one.wall_colour) for one in finishes],
        "roof_colour": [_format_colour(one.roof_colour) for one in finishes],
        "wall_material": _texts(finishes, "wall_material"),
        "roof_material": _texts(finishes, "roof_material"),
        "refused": [refused.get(b.id, "") for b in buildings],
    }


def _roof_columns(buildings: Sequence[Building]) -> dict[str, object]:
    return {
        "roof_shape": [b.roof.shape if b.roof else "" for b in buildings],
        "roof_height": [b.roof.height if b.roof else np.nan for b in buildings],
        "roof_confidence": [b.roof.confidence if b.roof else np.nan for b in buildings],
    }


def _plan_from_tables(tables: Mapping[str, TableValues], texels_per_metre: float) -> Plan:
    """Return the plan of tables."""
    charts, mesh, cameras, poses = (tables[name] for name in ("charts", "mesh", "viewpoints", "poses"))
    streets, buildings = tables["streets"], tables["buildings"]
    placement = placement_from_table(charts)
    spec = AtlasSpec(placement.pages, texels_per_metre, charts["page_size"], charts["chunk"], charts["gutter"])
    scene = Scene(
        _mesh_from_table(mesh),
        _from_columns(Charts, charts),
        placement,
        spec,
        spacing=cameras["spacing"],
        visibility_range=cameras["visibility_range"],
        names=buildings["id"],
        finishes=_finishes_from_table(buildings),
    )
    lines = [streets["point"][streets["point_street"] == i] for i in range(len(streets["id"]))]
    return Plan(
        scene=scene,
        streets=tuple(
            Street(id_, name or None, shapely.LineString(line))
            for id_, name, line in zip(streets["id"], streets["name"], lines, strict=True)
        ),
        ground=_ground_from_tables(tables["ways"], tables["areas"]),
        facades=_facades_from_table(tables["facades"]),
        poses=tuple(
            Pose(x, y, z, heading, pitch, roll, (left, top, width, height), lens_from_values(lens))
            for (x, y, z), (heading, pitch, roll), (left, top, width, height), lens in zip(
                *(poses[n].tolist() for n in ("position", "angles", "view")),
                poses.get("lens", np.zeros((len(poses["view"]), LENS_VALUES))).tolist(),
                strict=True,
            )
        ),
        rejected_buildings=tuple(
            (id_, why) for id_, why in zip(buildings["id"], buildings["refused"], strict=True) if why
        ),
        sightings=_from_columns(FacadeSightings, tables["sightings"]),
        textured=charts["textured"],
        viewpoints=tuple(
            Viewpoint(i, int(street), position, forward)
            for i, (street, position, forward) in enumerate(
                zip(cameras["street"], cameras["position"], cameras["forward"], strict=True)
            )
        ),
        views=np.column_stack([cameras["view_viewpoint"], cameras["view_chart"]]),
        writable=charts["writable"],
        ids=charts["id"],
        view_digests=cameras["look"],
        in_core=charts["own"],
        street_density=charts.get("street_texels_per_metre", placement.texels_per_metre),
        objects=_objects_from_table(tables["objects"]) if "objects" in tables else NO_OBJECTS,
        surroundings=_from_columns(SurroundingMesh, tables["surroundings"])
        if "surroundings" in tables
        else NO_SURROUNDINGS,
    )


def _objects_from_table(values: TableValues) -> PlacedObjects:
    kinds = np.array([OBJECT_KIND_NAMES.index(kind) for kind in values["kind"]], np.int32)
    is_stated = values.get("is_stated", np.ones(len(kinds), bool))
    return _from_columns(PlacedObjects, {**values, "kind": kinds, "is_stated": is_stated})


def _street_density_column(plan: Plan) -> dict[str, Float64Array]:
    """Return the column of densities by the streets; no column where pictures raise none."""
    if np.array_equal(plan.street_density, plan.scene.placement.texels_per_metre):
        return {}
    return {"street_texels_per_metre": plan.street_density}


def _lens_columns(poses: Sequence[Pose]) -> dict[str, Float64Array]:
    """Return the column of lenses, zeros of panoramas; no column without any lens."""
    if all(pose.lens is None for pose in poses):
        return {}
    rows = [[0.0] * LENS_VALUES if pose.lens is None else lens_values(pose.lens) for pose in poses]
    return {"lens": np.array(rows)}


def _finishes_from_table(buildings: TableValues) -> tuple[BuildingFinish, ...]:
    """Return the stated finishes of buildings."""
    columns = (buildings[name] for name in ("wall_colour", "roof_colour", "wall_material", "roof_material"))
    return tuple(
        BuildingFinish(_parse_colour(wall_colour), _parse_colour(roof_colour), wall or None, roof or None)
        for wall_colour, roof_colour, wall, roof in zip(*columns, strict=True)
    )


def _format_colour(colour: tuple[int, int, int] | None) -> str:
    return "" if colour is None else "#{:02x}{:02x}{:02x}".format(*colour)


def _parse_colour(text: str) -> tuple[int, int, int] | None:
    return (int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)) if text else None


def _ground_from_tables(ways: TableValues, areas: TableValues) -> MappedGround:
    names = ("id", "kind", "width", "surface", "assumed", "lanes", "oneway", "rank")
    columns = [ways[name] if isinstance(ways[name], tuple) else ways[name].tolist() for name in names]
    lines = [shapely.from_wkb(line) for line in ways["line"]]
    sides = [[tuple(pair) for pair in ways[name].tolist()] for name in ("pavement", "parking")]
    return MappedGround(
        tuple(
            GroundWay(line=line, pavement=pavement, parking=parking, **dict(zip(names, values, strict=True)))
            for line, pavement, parking, *values in zip(lines, *sides, *columns, strict=True)
        ),
        tuple(
            GroundArea(id, shapely.from_wkb(outline), surface)
            for id, outline, surface in zip(areas["id"], areas["outline"], areas["surface"], strict=True)
        ),
        shapely.from_wkb(areas["block"]) if areas["block"] else None,
    )


def _model_textures(mesh: Mesh) -> dict[str, object]:
    """Return the texture columns of a mesh; none where it has no texture."""
    return {"texture": mesh.texture, "uv": mesh.uv} if (mesh.texture >= 0).any() else {}


def _mesh_from_table(values: TableValues) -> Mesh:
    return Mesh(
        vertices=values["vertices"],
        triangles=values["triangles"],
        chart=values["triangle_chart"],
        vertex_chart=values["vertex_chart"],
        **{name: values[name] for name in ("texture", "uv") if name in values},
    )


def _street_points(street: Street) -> Float64Array:
    points: Float64Array = shapely.get_coordinates(street.line)
    return points
