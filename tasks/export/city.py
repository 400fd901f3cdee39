"""CityJSON 2.0 of a published block: whole, as a stream, and with openings."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.printable_text import escape_invisible_json
from catalogs.readers.annotations import EXPORTED_HEIGHT_ATTRIBUTE
from facade_core.core.types import Element
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.models import with_ground
from tasks.publish.opened import Published

if TYPE_CHECKING:
    from facade_core.export.bodies.building_models import BuildingModel

TEXTURES = "textures"
# What a building is of, as it was stated or corrected, by the names of attributes.
MADE_OF = {
    "wallMaterial": "wall_material",
    "wallColour": "wall_colour",
    "roofMaterial": "roof_material",
    "roofColour": "roof_colour",
}


def write_cityjson(found: Published, buildings: np.ndarray, folder: Path) -> tuple[list[str], list[str]]:
    """BLOCK.city.json with its textures beside it."""
    return _write_document(found, buildings, folder, f"{found.block}.city.json", openings=False)


def write_lod3(found: Published, buildings: np.ndarray, folder: Path) -> tuple[list[str], list[str]]:
    """BLOCK.lod3.city.json: the windows and doors of completed facades cut out of their walls."""
    return _write_document(found, buildings, folder, f"{found.block}.lod3.city.json", openings=True)


def write_cityjsonseq(found: Published, buildings: np.ndarray, folder: Path) -> tuple[list[str], list[str]]:
    """BLOCK.city.jsonl: a header, then a feature per line, with textures beside it."""
    from facade_core.export.city_models.cityjson import VertexPool, empty_document

    url, notes = _reference_system(found)
    origin = origin_of(found)
    images, objects = _objects(found, buildings, folder, openings=False)
    name = f"{found.block}.city.jsonl"
    with (folder / name).open("w", encoding="utf-8") as file:
        file.write(_line(empty_document(found.block, origin, url, found.attribution)))
        for id, make in objects:
            pool = VertexPool(origin)
            made = make(pool)
            feature = {"type": "CityJSONFeature", "id": id, "CityObjects": made} | pool.tables(images)
            file.write(_line(feature))
    return [name], notes


def _write_document(
    found: Published, buildings: np.ndarray, folder: Path, name: str, *, openings: bool
) -> tuple[list[str], list[str]]:
    from facade_core.export.city_models.cityjson import VertexPool, empty_document

    url, notes = _reference_system(found)
    pool = VertexPool(origin_of(found))
    images, objects = _objects(found, buildings, folder, openings=openings)
    city = empty_document(found.block, pool.origin, url, found.attribution)
    city["CityObjects"] = {id: made for _, make in objects for id, made in make(pool).items()}
    city |= pool.tables(images)
    city["metadata"]["geographicalExtent"] = pool.extent()
    (folder / name).write_text(_line(city), encoding="utf-8")
    return [name], notes


def _line(value: dict[str, Any]) -> str:
    return escape_invisible_json(json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)) + "\n"


def _objects(
    found: Published, buildings: np.ndarray, folder: Path, *, openings: bool
) -> tuple[list[str], Iterator[tuple[str, Callable[[Any], dict[str, Any]]]]]:
    """The files of the texture pages, which are written, and every feature as (id, what makes its city objects in a pool)."""
    from facade_core.core.grouping import group_rows
    from facade_core.export.bodies.building_models import ground_faces
    from facade_core.export.city_models.cityjson import build_geometry
    from facade_core.export.models.textured_mesh import GROUND_NODE, encode_page, pack_charts

    source = found.textured
    shown = with_ground(found, buildings)
    drawn = pack_charts(source, source.select_charts(shown))
    pages = len(drawn.layout.pages)
    begin_stage("export", pages + len(shown))
    images = [f"{TEXTURES}/{page:04}.jpg" for page in range(pages)]
    (folder / TEXTURES).mkdir()
    for page, image in enumerate(images):
        (folder / image).write_bytes(encode_page(drawn, page))
        report_progress("export", 1)
    layouts = facade_layouts(found, buildings) if openings else {}
    triangles = group_rows(source.charts.building[source.mesh.chart])
    taken = set(found.names.values())

    def building(index: int, pool: Any) -> dict[str, Any]:
        made = building_objects(found, drawn, triangles[index], index, layouts, pool, taken)
        report_progress("export", 1)
        return made

    def terrain(id: str, faces: Any, pool: Any) -> dict[str, Any]:
        return {id: {"type": "TINRelief", "geometry": [build_geometry(faces, (), pool, "2", "CompositeSurface")]}}

    def features() -> Iterator[tuple[str, Callable[[Any], dict[str, Any]]]]:
        for index in buildings.tolist():
            yield found.names[index], partial(building, index)
        if -1 in shown and -1 in triangles:
            for number, faces in enumerate(ground_faces(drawn, triangles[-1], origin_of(found))):
                id = _free(f"{GROUND_NODE}-{number}" if number else GROUND_NODE, taken)
                yield id, partial(terrain, id, faces)
            report_progress("export", 1)

    return images, features()


def building_objects(
    found: Published,
    drawn: Any,
    triangles: np.ndarray,
    index: int,
    layouts: Mapping[int, list[Element]],
    pool: Any,
    taken: set[str],
) -> dict[str, Any]:
    """A building and its installations by id: a Solid where its surfaces close, and what stands out of it."""
    from facade_core.export.city_models.cityjson import build_geometry

    made = model_of(found, drawn, triangles, index, layouts, pool.origin)
    opened = any(surface["type"] in ("Window", "Door") for surface in made.body.surfaces)
    name, lod = found.names[index], "3" if opened else "2"

    def geometry(part: Any) -> list[dict[str, Any]]:
        return [build_geometry(part.faces, part.surfaces, pool, lod, "Solid" if part.is_solid else "MultiSurface")]

    attributes = attributes_of(found, index, made.body)
    attributes[EXPORTED_HEIGHT_ATTRIBUTE] = attributes["measuredHeight"]
    for surface in made.body.surfaces:
        if "facade" in surface:
            surface["isFacade"] = is_facade(found, surface["facade"])
    body = {"type": "Building", "attributes": attributes, "geometry": geometry(made.body)}
    wanted: list[tuple[str, dict[str, Any], Any]] = [("roof", {}, part) for part in made.attachments]
    if layouts:
        wanted += [("balcony", {"class": "balcony", "facade": facade}, part) for facade, part in made.balconies]
        wanted += [("ledge", {"class": "ledge", "facade": facade}, part) for facade, part in made.ledges]
    installations: dict[str, Any] = {}
    for number, (kind, attributes, part) in enumerate(wanted):
        installations[_free(f"{name}-{kind}-{number}", taken)] = {
            "type": "BuildingInstallation",
            **({"attributes": attributes} if attributes else {}),
            "parents": [name],
            "geometry": geometry(part),
        }
    return {name: body | ({"children": list(installations)} if installations else {})} | installations


def is_facade(found: Published, facade: str) -> bool:
    """Whether a wall is a facade still, and nobody said that it is none."""
    record = found.records[found.plan.facades.id.index(facade)]
    return record is None or record.get("facade") is not False


def model_of(
    found: Published,
    drawn: Any,
    triangles: np.ndarray,
    index: int,
    layouts: Mapping[int, list[Element]],
    origin: np.ndarray,
) -> BuildingModel:
    """A building as faces on the grid around `origin` (3,), with the openings and balconies of `layouts`."""
    from facade_core.export.bodies.building_models import build_building_model

    assumed = float(found.buildings["roof_confidence"][index]) < 1 if "roof_confidence" in found.buildings else False
    facades = dict(zip(found.plan.facades.chart.tolist(), found.plan.facades.id, strict=True))
    return build_building_model(drawn, triangles, facades, layouts, origin, has_assumed_roof=assumed)


def _free(id: str, taken: set[str]) -> str:
    """An id that no building has: this one, or with so many dashes behind it."""
    while id in taken:
        id += "-"
    return id


def attributes_of(found: Published, building: int, body: Any) -> dict[str, Any]:
    """What the plan and the finished facades say of a building, by CityJSON's own names where it has some; its height is that
    of the highest place of its roof over its lowest corner, chimneys and what else stands beside its body left out."""
    row = {name: column[building] for name, column in found.buildings.items()}
    facades = [found.records[i] for i in found.rectified(np.array([building]))]
    levels, name = int(row["levels"]), row["name"]
    return {
        **({"name": name} if name else {}),
        "measuredHeight": round(_rise(body), 3),
        "heightSource": row["height_source"],
        **({"storeysAboveGround": levels} if levels else {}),
        **({"partOf": row["part_of"]} if row.get("part_of") else {}),
        **_roof(row),
        **{name: row[what] for name, what in MADE_OF.items() if row.get(what)},
        "facades": len(facades),
        **{key: sum(record[key] for record in facades if record) for key in ("windows", "doors", "balconies", "shops")},
    }


def measured_heights(found: Published) -> dict[str, float]:
    """The height of each building by its id, as exports state it."""
    from facade_core.core.grouping import group_rows
    from facade_core.export.models.textured_mesh import pack_charts

    source, buildings = found.textured, found.choose(())
    drawn = pack_charts(source, source.select_charts(with_ground(found, buildings)))
    triangles = group_rows(source.charts.building[source.mesh.chart])
    bodies = {b: model_of(found, drawn, triangles[b], b, {}, origin_of(found)).body for b in buildings.tolist()}
    return {found.names[b]: round(_rise(body), 3) for b, body in bodies.items()}


def _rise(body: Any) -> float:
    """Metres from the lowest to the highest corner of a building's faces."""
    heights = np.concatenate([ring[:, 2] for face in body.faces for ring in face.rings])
    return float(np.ptp(heights))


def _roof(row: Mapping[str, Any]) -> dict[str, Any]:
    """What there is to say of a building's roof: of a model, and in an older store, nothing."""
    if not row.get("roof_shape"):
        return {}
    height, confidence = (round(float(row[name]), 3) for name in ("roof_height", "roof_confidence"))
    eaves = round(float(row["height"]), 3)
    return {"roofType": row["roof_shape"], "eavesHeight": eaves, "roofHeight": height, "roofConfidence": confidence}


def facade_layouts(found: Published, buildings: np.ndarray) -> dict[int, list[Element]]:
    """The elements of the finished facades of some buildings by their charts, in metres, with the ledges that pictures show."""
    from facade_core.export.bodies.ledges import detect_ledges
    from facade_core.export.pictures.stage_pictures import read_chart_raster

    placement = found.plan.scene.placement
    layouts = {}
    for index in found.rectified(buildings):
        chart = int(found.plan.facades.chart[index])
        density = float(placement.texels_per_metre[chart])
        elements = [
            replace(e, **{side: getattr(e, side) / density for side in ("x0", "y0", "x1", "y1")})
            for e in found.elements(index)
        ]
        seed, labels = (
            read_chart_raster(found.group, placement, chart, name) for name in ("atlas/seed", "facade_maps/labels")
        )
        layouts[chart] = [*elements, *detect_ledges(seed, labels, elements, density)]
    return layouts


def origin_of(found: Published) -> np.ndarray:
    return np.floor(found.plan.scene.mesh.vertices.min(axis=0))


def _reference_system(found: Published) -> tuple[str | None, list[str]]:
    """The URL of the block's CRS; None with a note where no authority knows it."""
    from pyproj import CRS

    authority = CRS.from_user_input(found.crs).to_authority()
    if authority is None:
        return None, [f"{found.crs} has no code: the file states no referenceSystem; give it to whoever opens it"]
    return "https://www.opengis.net/def/crs/{}/0/{}".format(*authority), []
