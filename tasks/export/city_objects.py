"""CityJSON objects of buildings: faces with openings and balconies, attributes, and the frame of the document."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from catalogs.readers.annotations import EXPORTED_HEIGHT_ATTRIBUTE
from facade_core.core.arrays import Float64Array, IntArray
from facade_core.core.grouping import group_rows
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import ELEMENT_PLURALS
from facade_core.core.types import Element
from facade_core.export.bodies.alignment import align_with_picture
from facade_core.export.bodies.building_models import BuildingModelParts, ModelPart, build_building_model_parts
from facade_core.export.city_models.cityjson import VertexPool, build_geometry
from facade_core.export.models.textured_mesh import PackedCharts, pack_charts_on_pages
from tasks.export.models import append_ground_index
from tasks.export.relief import facade_elements
from tasks.publish.published_run import PublishedBlock

# Columns of building materials and colours by attribute name.
APPEARANCE_ATTRIBUTES = {
    "wallMaterial": "wall_material",
    "wallColour": "wall_colour",
    "roofMaterial": "roof_material",
    "roofColour": "roof_colour",
}


def building_city_objects(
    results: PublishedBlock,
    drawn: PackedCharts,
    triangles: IntArray,
    index: int,
    layouts: Mapping[int, list[Element]],
    pool: VertexPool,
    taken: set[str],
) -> JsonObject:
    """Build the CityJSON objects of one building and of its installations, by id.

    The building is a Solid if its surfaces close.

    Parameters
    ----------
    results : published results of a block.
    drawn : charts packed on texture pages.
    triangles : (n,) triangles of the building.
    index : index of the building.
    layouts : elements by chart, metres; empty for a model without openings.
    pool : vertex pool of the document.
    taken : ids in use; new ids are added.
    """
    model = building_model(results, drawn, triangles, index, layouts, pool.origin)
    has_openings = any(surface["type"] in ("Window", "Door") for surface in model.body.surfaces)
    name, lod = results.names[index], "3" if has_openings else "2"

    def geometry(part: ModelPart) -> list[JsonObject]:
        return [build_geometry(part.faces, part.surfaces, pool, lod, "Solid" if part.is_solid else "MultiSurface")]

    attributes = building_attributes(results, index, model.body)
    attributes[EXPORTED_HEIGHT_ATTRIBUTE] = attributes["measuredHeight"]
    for surface in model.body.surfaces:
        if "facade" in surface:
            surface["isFacade"] = is_facade(results, surface["facade"])
    body = {"type": "Building", "attributes": attributes, "geometry": geometry(model.body)}
    wanted: list[tuple[str, JsonObject, ModelPart]] = [("roof", {}, part) for part in model.attachments]
    if layouts:
        wanted += [("balcony", {"class": "balcony", "facade": facade}, part) for facade, part in model.balconies]
        wanted += [("ledge", {"class": "ledge", "facade": facade}, part) for facade, part in model.ledges]
    installations: JsonObject = {}
    for number, (kind, attributes, part) in enumerate(wanted):
        installations[unused_id(f"{name}-{kind}-{number}", taken)] = {
            "type": "BuildingInstallation",
            **({"attributes": attributes} if attributes else {}),
            "parents": [name],
            "geometry": geometry(part),
        }
    return {name: body | ({"children": list(installations)} if installations else {})} | installations


def is_facade(results: PublishedBlock, facade: str) -> bool:
    """Report whether a wall is still a facade: no correction denies it."""
    record = results.records[results.plan.facades.id.index(facade)]
    return record is None or record.get("facade") is not False


def building_model(
    results: PublishedBlock,
    drawn: PackedCharts,
    triangles: IntArray,
    index: int,
    layouts: Mapping[int, list[Element]],
    origin: Float64Array,
) -> BuildingModelParts:
    """Build a building's faces, with the openings and balconies of `layouts`.

    Parameters
    ----------
    results : published results of a block.
    drawn : charts packed on texture pages.
    triangles : (n,) triangles of the building.
    index : index of the building.
    layouts : elements by chart, metres.
    origin : (3,) origin of the vertex grid, world metres.
    """
    assumed = (
        float(results.buildings["roof_confidence"][index]) < 1 if "roof_confidence" in results.buildings else False
    )
    facades = dict(zip(results.plan.facades.chart.tolist(), results.plan.facades.id, strict=True))
    return build_building_model_parts(drawn, triangles, facades, layouts, origin, has_assumed_roof=assumed)


def unused_id(id: str, taken: set[str]) -> str:
    """Append dashes to an id until no building has it."""
    while id in taken:
        id += "-"
    return id


def building_attributes(results: PublishedBlock, building: int, body: ModelPart) -> JsonObject:
    """Collect a building's attributes from the plan and the finished facades, with CityJSON names.

    The measured height ends at the highest point of the roof, without chimneys and other attachments.
    """
    row = {name: column[building] for name, column in results.buildings.items()}
    facades: list[Mapping[str, Any] | None] = [
        results.records[i] for i in results.select_finished_facades(np.array([building]))
    ]
    levels, name = int(row["levels"]), row["name"]
    return {
        **({"name": name} if name else {}),
        "measuredHeight": round(_height_range(body), 3),
        "heightSource": row["height_source"],
        **({"storeysAboveGround": levels} if levels else {}),
        **({"partOf": row["part_of"]} if row.get("part_of") else {}),
        **_roof_attributes(row),
        **{name: row[what] for name, what in APPEARANCE_ATTRIBUTES.items() if row.get(what)},
        "facades": len(facades),
        **{key: sum(record[key] for record in facades if record) for key in ELEMENT_PLURALS.values()},
    }


def compute_building_heights(results: PublishedBlock) -> dict[str, float]:
    """Compute the measured height of each building by id, as exports state it."""
    source, buildings = results.textured_mesh, results.select_buildings(())
    drawn = pack_charts_on_pages(source, source.select_charts(append_ground_index(results, buildings)))
    triangles = group_rows(source.charts.building[source.mesh.chart])
    bodies = {
        b: building_model(results, drawn, triangles[b], b, {}, model_origin(results)).body for b in buildings.tolist()
    }
    return {results.names[b]: round(_height_range(body), 3) for b, body in bodies.items()}


def _height_range(body: ModelPart) -> float:
    """Compute the metres between the lowest and the highest corner of a building's faces."""
    heights = np.concatenate([ring[:, 2] for face in body.faces for ring in face.rings])
    return float(np.ptp(heights))


def _roof_attributes(row: JsonObject) -> JsonObject:
    """Collect the attributes of a building's roof; older stores have none."""
    if not row.get("roof_shape"):
        return {}
    height, confidence = (round(float(row[name]), 3) for name in ("roof_height", "roof_confidence"))
    eaves = round(float(row["height"]), 3)
    return {"roofType": row["roof_shape"], "eavesHeight": eaves, "roofHeight": height, "roofConfidence": confidence}


def facade_layouts(results: PublishedBlock, buildings: IntArray) -> dict[int, list[Element]]:
    """Read the elements of finished facades by chart, in metres, aligned with their pictures, and with ledges."""
    source = results.textured_mesh
    return {
        chart: align_with_picture(source.raster(chart), source.texels[chart] / source.extent[chart], elements)
        for chart, elements in facade_elements(results, buildings).items()
    }


def model_origin(results: PublishedBlock) -> Float64Array:
    """Return the origin (3,) of a model's local frame, world metres."""
    origin: Float64Array = np.floor(results.plan.scene.mesh.vertices.min(axis=0))
    return origin


def reference_system(crs: str) -> tuple[str | None, list[str]]:
    """Return the URL of a CRS; None and a note if it has no authority code."""
    from pyproj import CRS

    authority = CRS.from_user_input(crs).to_authority()
    if authority is None:
        return None, [f"{crs} has no code: the file states no referenceSystem; give it to whoever opens it"]
    return "https://www.opengis.net/def/crs/{}/0/{}".format(*authority), []
