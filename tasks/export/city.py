"""CityJSON 2.0 of a published block: a document, a stream of features, or LoD3 with openings."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TextIO

from catalogs.printable_text import escape_invisible_json
from facade_core.core.arrays import Float64Array, IntArray
from facade_core.core.grouping import group_rows
from facade_core.core.json_types import JsonObject
from facade_core.export.bodies.building_models import ground_faces
from facade_core.export.bodies.model_face import ModelFace
from facade_core.export.city_models.cityjson import VertexPool, build_geometry, empty_document
from facade_core.export.models.textured_mesh import GROUND_NODE
from tasks.engine.progress import report_progress
from tasks.export.city_objects import (
    building_city_objects,
    facade_layouts,
    model_origin,
    reference_system,
    unused_id,
)
from tasks.export.models import append_ground_index, write_texture_pages
from tasks.publish.published_run import PublishedBlock


def write_cityjson(
    results: PublishedBlock, buildings: IntArray, folder: Path, *, openings: bool
) -> tuple[list[str], list[str]]:
    """Write a CityJSON document and its textures.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.
    openings : windows and doors of completed facades are cut out of their walls: BLOCK.lod3.city.json, else
        BLOCK.city.json.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    name = f"{results.block}{'.lod3' if openings else ''}.city.json"
    url, notes = reference_system(results.crs)
    pool = VertexPool(model_origin(results))
    images, objects = _list_features(results, buildings, folder, pool.origin, openings=openings)
    city = empty_document(results.block, pool.origin, url, results.attribution)
    city["CityObjects"] = {id: made for _, make in objects for id, made in make(pool).items()}
    city |= pool.tables(images)
    city["metadata"]["geographicalExtent"] = pool.extent()
    (folder / name).write_text(json_line(city), encoding="utf-8")
    return [name], notes


def write_cityjsonseq(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write BLOCK.city.jsonl, a header and one feature a line, and its textures.

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
    url, notes = reference_system(results.crs)
    origin = model_origin(results)
    name = f"{results.block}.city.jsonl"
    with (folder / name).open("w", encoding="utf-8") as file:
        file.write(json_line(empty_document(results.block, origin, url, results.attribution)))
        write_features(results, buildings, folder, file, origin)
    return [name], notes


def write_features(
    results: PublishedBlock,
    buildings: IntArray,
    folder: Path,
    file: TextIO,
    origin: Float64Array,
    *,
    openings: bool = False,
    folder_name: str = "",
    rename: Callable[[str, bool], str] = lambda id, is_building: id,
) -> None:
    """Write a CityJSONFeature a line, and the textures into a folder.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : folder of the textures.
    file : file of the lines.
    origin : (3,) origin of the vertex grid, world metres.
    openings : with the openings, balconies and ledges of `lod3`.
    folder_name : path of the folder relative to the file, ending in a slash; empty if the file is in it.
    rename : returns the id of an object in the file, by its id and whether it is a building.
    """
    images, objects = _list_features(results, buildings, folder, origin, openings=openings)
    images = [f"{folder_name}{image}" for image in images]
    for id, make in objects:
        pool = VertexPool(origin)
        made = make(pool)
        names = {one: rename(one, thing["type"] == "Building") for one, thing in made.items()}
        for thing in made.values():
            for relation in ("parents", "children"):
                if relation in thing:
                    thing[relation] = [names[one] for one in thing[relation]]
        named = {names[one]: thing for one, thing in made.items()}
        feature = {"type": "CityJSONFeature", "id": names[id], "CityObjects": named} | pool.tables(images)
        file.write(json_line(feature))


def json_line(value: JsonObject) -> str:
    """Return a value as one line of JSON."""
    return escape_invisible_json(json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)) + "\n"


def _list_features(
    results: PublishedBlock, buildings: IntArray, folder: Path, origin: Float64Array, *, openings: bool
) -> tuple[list[str], Iterator[tuple[str, Callable[[VertexPool], JsonObject]]]]:
    """Write the texture pages; return their files, and each feature as (id, builder of its city objects)."""
    source = results.textured_mesh
    shown = append_ground_index(results, buildings)
    drawn, images = write_texture_pages(results.textured_mesh, shown, folder, len(shown))
    layouts = facade_layouts(results, buildings) if openings else {}
    triangles = group_rows(source.charts.building[source.mesh.chart])
    taken = set(results.names.values())

    def building(index: int, pool: VertexPool) -> JsonObject:
        made = building_city_objects(results, drawn, triangles[index], index, layouts, pool, taken)
        report_progress("export", 1)
        return made

    def terrain(id: str, faces: Sequence[ModelFace], pool: VertexPool) -> JsonObject:
        return {id: {"type": "TINRelief", "geometry": [build_geometry(faces, (), pool, "2", "CompositeSurface")]}}

    def features() -> Iterator[tuple[str, Callable[[VertexPool], JsonObject]]]:
        for index in buildings.tolist():
            yield results.names[index], partial(building, index)
        if -1 in shown and -1 in triangles:
            for number, faces in enumerate(ground_faces(drawn, triangles[-1], origin)):
                id = unused_id(f"{GROUND_NODE}-{number}" if number else GROUND_NODE, taken)
                yield id, partial(terrain, id, faces)
            report_progress("export", 1)

    return images, features()
