"""CityGML 2.0 of a published block, with textures: the solids of `lod3` for readers without CityJSON."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from catalogs.features import safe_file_stem
from catalogs.printable_text import escape_invisible
from facade_core.core.arrays import IntArray
from facade_core.core.grouping import group_rows
from facade_core.core.types import Element as FacadeElement
from facade_core.export.bodies.building_models import ModelPart, ground_faces
from facade_core.export.city_models.citygml import (
    NAMESPACES,
    PolygonWriter,
    add_attribute,
    add_xml_element,
    boundary_surfaces,
    expand_prefix,
    open_citygml_writer,
    solid_element,
    xml_id,
)
from facade_core.export.city_models.cityjson import VertexPool
from facade_core.export.models.textured_mesh import GROUND_NODE, PackedCharts
from tasks.engine.progress import report_progress
from tasks.export.city_objects import building_attributes, building_model, facade_layouts, model_origin
from tasks.export.models import append_ground_index, write_texture_pages
from tasks.publish.published_run import PublishedBlock

# Attributes with a CityGML element of their own; all others become generic attributes.
CITYGML_ATTRIBUTES = ("name", "roofType", "measuredHeight", "storeysAboveGround")


def write_citygml(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write BLOCK.gml and its textures: LoD3 for buildings with openings, else LoD2.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    source, shown = results.textured_mesh, append_ground_index(results, buildings)
    drawn, images = write_texture_pages(results.textured_mesh, shown, folder, len(shown))
    triangles = group_rows(source.charts.building[source.mesh.chart])
    layouts = facade_layouts(results, buildings)
    ids = {index: xml_id(results.names[index]) for index in buildings.tolist()}
    selection = np.concatenate([triangles[index] for index in shown.tolist() if index in triangles])
    corners = source.mesh.vertices[source.mesh.triangles[selection].ravel()]
    extent = np.array([corners.min(axis=0), corners.max(axis=0)])
    name = f"{safe_file_stem(results.block)}.gml"
    with open_citygml_writer(folder / name, results.block, results.crs, extent, results.attribution) as file:
        for index in buildings.tolist():
            file.write(_building(results, drawn, triangles[index], index, ids[index], layouts, images))
            report_progress("export", 1)
        if -1 in shown and -1 in triangles:
            for element in _terrain(results, drawn, triangles[-1], set(ids.values()), images):
                file.write(element)
            report_progress("export", 1)
    return [name], []


def _building(
    results: PublishedBlock,
    drawn: PackedCharts,
    triangles: IntArray,
    index: int,
    id: str,
    layouts: Mapping[int, list[FacadeElement]],
    images: list[str],
) -> Element:

    origin = model_origin(results)
    model = building_model(results, drawn, triangles, index, layouts, origin)
    lod = "3" if any(surface["type"] in ("Window", "Door") for surface in model.body.surfaces) else "2"
    textured = PolygonWriter(id, VertexPool(origin))
    bounds, ids = boundary_surfaces(textured, model.body.faces, model.body.surfaces, lod)
    installations = []
    wanted: list[tuple[str, dict[str, str], ModelPart]] = [("roof", {}, part) for part in model.attachments]
    wanted += [("balcony", {"facade": facade}, part) for facade, part in model.balconies]
    wanted += [("ledge", {"facade": facade}, part) for facade, part in model.ledges]
    for number, (kind, said, part) in enumerate(wanted):
        textured.prefix = f"{id}-{kind}-{number}"
        installations.append(
            (textured.prefix, kind, said, boundary_surfaces(textured, part.faces, part.surfaces, lod)[0])
        )
    said = building_attributes(results, index, model.body)
    member = _member()
    building = add_xml_element(member, "bldg:Building", gml_id=id)
    if "name" in said:
        add_xml_element(building, "gml:name", escape_invisible(said["name"]))
    for key, value in {"id": results.names[index], **said}.items():
        if key not in CITYGML_ATTRIBUTES:
            add_attribute(building, key, escape_invisible(value) if isinstance(value, str) else value)
    textured.add_appearance(building, images)
    if "roofType" in said:
        add_xml_element(building, "bldg:roofType", said["roofType"])
    add_xml_element(building, "bldg:measuredHeight", said["measuredHeight"], uom="m")
    if "storeysAboveGround" in said:
        add_xml_element(building, "bldg:storeysAboveGround", said["storeysAboveGround"])
    shell = [solid_element(lod, ids)] if model.body.is_solid else []
    if lod == "2":
        building.extend(shell)
    for prefix, kind, own, within in installations:
        thing = add_xml_element(
            add_xml_element(building, "bldg:outerBuildingInstallation"), "bldg:BuildingInstallation", gml_id=prefix
        )
        for key, value in own.items():
            add_attribute(thing, key, value)
        add_xml_element(thing, "bldg:function", kind)
        thing.extend(within)
    building.extend(bounds)
    if lod == "3":
        building.extend(shell)
    return member


def _terrain(
    results: PublishedBlock, drawn: PackedCharts, triangles: IntArray, taken: set[str], images: list[str]
) -> list[Element]:
    """Build relief features of the ground, one for each triangulated surface."""
    origin, members = model_origin(results), []
    for number, faces in enumerate(ground_faces(drawn, triangles, origin)):
        id = f"{GROUND_NODE}-{number}"
        while id in taken:
            id += "-"
        textured = PolygonWriter(id, VertexPool(origin))
        member = _member()
        relief = add_xml_element(member, "dem:ReliefFeature", gml_id=id)
        add_xml_element(relief, "dem:lod", 2)
        tin = add_xml_element(add_xml_element(relief, "dem:reliefComponent"), "dem:TINRelief", gml_id=f"{id}-relief")
        add_xml_element(tin, "dem:lod", 2)
        textured.add_triangles(add_xml_element(tin, "dem:tin"), faces)
        textured.add_appearance(tin, images)
        tin.insert(0, tin[-1])
        members.append(member)
    return members


def _member() -> Element:

    return etree.Element(expand_prefix("cityObjectMember"), nsmap=NAMESPACES)
