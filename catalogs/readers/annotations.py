"""Readers of corrections: COCO, LabelMe, GeoPackage tables, CityJSON attributes and Streetloom's own JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from catalogs.features import safe_file_stem
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers import gdal_files
from catalogs.readers.json_text import load_json, parse_json_object
from catalogs.readers.pictures.picture_kinds import is_system_file
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import MAX_TEXT_BYTES, read_regular

# (id of a facade or building, corrected property, value): see `catalogs.block.corrections`.
Annotation = tuple[str, str, object]
# Property of a `CityJsonHeights`: an edit of it changes the eaves.
MEASURED_HEIGHT = "measured height"


class CityJsonHeights(NamedTuple):
    """Heights of a building in an edited CityJSON export, metres; None where it is not stated.

    Attributes
    ----------
    height : to the ridge, as it is now.
    exported : to the ridge, as it was exported.
    eaves : to the eaves.
    """

    height: object
    exported: object
    eaves: object


# Property by column of the GeoPackage table `buildings`, and by attribute of CityJSON buildings.
GEOPACKAGE_COLUMNS = {
    "height_m": "height", "levels": "levels", "roof_shape": "roof_shape", "roof_height_m": "roof_height",
    "wall_material": "wall_material", "roof_material": "roof_material", "wall_colour": "wall_colour",
    "roof_colour": "roof_colour",
}  # fmt: skip
CITYJSON_ATTRIBUTES = {
    "eavesHeight": "height", "storeysAboveGround": "levels", "roofType": "roof_shape", "roofHeight": "roof_height",
    "wallMaterial": "wall_material", "roofMaterial": "roof_material", "wallColour": "wall_colour",
    "roofColour": "roof_colour",
}  # fmt: skip
# Attribute with the measured height at export; a difference is an edit.
EXPORTED_HEIGHT_ATTRIBUTE = "measuredHeightExported"
# Column of the GeoPackage table `facades`: True for a facade.
IS_FACADE_COLUMN = "is_facade"


def read_correction_annotations(path: Path, facades: dict[str, str]) -> list[Annotation]:
    """Read corrections from a file of annotations, or from a folder of LabelMe files.

    Boxes become shares of the picture.

    Parameters
    ----------
    path : file or folder.
    facades : facade id by the name of its picture.

    Returns
    -------
    (id of a facade or building, corrected property, value) of each annotation.

    Raises
    ------
    InputError
        One line with the file and the remedy.
    """
    found = _read_file(path, facades)
    for id, *_ in found:
        if not isinstance(id, str) or not id:
            raise InputError(f"{path}: {str(id)[:40]!r} is no id of a facade or building; write it as it was exported")
    return found


def _read_file(path: Path, facades: dict[str, str]) -> list[Annotation]:
    if path.is_dir():
        files = sorted(
            file for file in path.glob("*.json") if file.name != "export.json" and not is_system_file(file.name)
        )
        if not files:
            raise InputError(f"{path} holds no .json of COCO or LabelMe; give the folder that an export wrote")
        return list(chain.from_iterable(read_correction_annotations(file, facades) for file in files))
    if path.suffix.lower() == ".gpkg":
        return _read_geopackage(path)
    with wrap_reader_errors(path, "cannot be understood", "export it again"):
        if path.suffix.lower() == ".jsonl":
            return list(chain.from_iterable(map(_parse_cityjson, _read_json_lines(path))))
        document = load_json(path, MAX_TEXT_BYTES)
        if isinstance(document, dict) and (found := _parse_document(document, facades, str(path))) is not None:
            return found
    raise InputError(
        f'{path} is neither COCO nor LabelMe nor CityJSON, nor {{"corrections": [...]}}; catalogs/README.md shows each'
    )


def _parse_document(document: JsonObject, facades: dict[str, str], name: str) -> list[Annotation] | None:
    """Return the corrections of a JSON object; None where it is of no known kind."""
    if document.get("type") == "CityJSON":
        return list(_parse_cityjson(document))
    if {"images", "annotations"} <= document.keys():
        return _parse_coco(document, facades)
    if "shapes" in document:
        return [_parse_labelme(document, facades)]
    if isinstance(document.get("corrections"), list):
        return parse_correction_annotations(document["corrections"], name)
    return None


def parse_correction_annotations(corrections: Sequence[object], source_name: str) -> list[Annotation]:
    """Return the annotations of corrections in Streetloom's own JSON.

    Raises
    ------
    InputError
        One line that begins with `source_name`.
    """
    with wrap_reader_errors(source_name, "cannot be understood", "catalogs/README.md shows what can be"):
        return [annotation for one in corrections for annotation in _parse_correction(one)]


def _parse_coco(document: JsonObject, facades: dict[str, str]) -> list[Annotation]:
    names = {one["id"]: one["name"] for one in document["categories"]}
    found: dict[int, list[tuple[str, float, float, float, float]]] = {image["id"]: [] for image in document["images"]}
    sizes = {image["id"]: (float(image["width"]), float(image["height"])) for image in document["images"]}
    for one in document["annotations"]:
        width, height = sizes[one["image_id"]]
        x, y, w, h = map(float, one["bbox"])
        found[one["image_id"]].append(
            (names[one["category_id"]], x / width, y / height, (x + w) / width, (y + h) / height)
        )
    facade_ids = {
        image["id"]: image.get("facade") or _facade_id(image["file_name"], facades) for image in document["images"]
    }
    return [(facade_ids[image], "elements", elements) for image, elements in found.items()]


def _parse_labelme(document: JsonObject, facades: dict[str, str]) -> Annotation:
    width, height = float(document["imageWidth"]), float(document["imageHeight"])
    elements = []
    for shape in document["shapes"]:
        if shape.get("shape_type") == "circle":  # its points are the centre and one on the circle
            raise ValueError(f"{shape['label']} is a circle; draw a rectangle")
        xs, ys = zip(*((float(x), float(y)) for x, y in shape["points"]), strict=True)
        elements.append((shape["label"], min(xs) / width, min(ys) / height, max(xs) / width, max(ys) / height))
    return document.get("facade") or _facade_id(document["imagePath"], facades), "elements", elements


def _facade_id(file: str, facades: dict[str, str]) -> str:
    """Return the id of the facade of a picture by the file name."""
    stem = Path(file.replace("\\", "/")).stem
    return facades.get(stem, stem)


def _parse_correction(one: object) -> Iterator[Annotation]:
    if not isinstance(one, Mapping):
        raise ValueError(f"{str(one)[:40]!r} is no correction")
    id = one.get("facade_id") or one.get("building_id")
    if not isinstance(id, str) or (one.get("facade_id") and one.get("building_id")):
        raise ValueError("a correction names its facade_id or building_id")
    for what, value in one.items():
        if what not in ("facade_id", "building_id"):
            yield id, what, value


def _read_json_lines(path: Path) -> Iterator[JsonObject]:
    for number, line in enumerate(read_regular(path).split(b"\n"), 1):
        if line.strip():
            yield parse_json_object(line, f"{path}: line {number}")


def _read_geopackage(path: Path) -> list[Annotation]:
    """Return the annotations of the tables `buildings` and `facades`; missing tables and columns have none."""
    facade_columns = {IS_FACADE_COLUMN: "facade"}
    found: list[Annotation] = []
    known = False
    with wrap_reader_errors(path, "cannot be read", "give one that `export --format gpkg` wrote"):
        layers = {name for name, _ in gdal_files.list_layers(path)}
        for layer, names in (("buildings", GEOPACKAGE_COLUMNS), ("facades", facade_columns)):
            if layer not in layers:
                continue
            table = gdal_files.read_dataframe(path, layer=layer, read_geometry=False)
            if "id" not in table or table.columns.intersection(list(names)).empty:
                continue
            known = True
            for row in table.to_dict("records"):
                found += _row_annotations(row, names)
    if not known:
        raise InputError(
            f"{path} has no table buildings with id and {', '.join(GEOPACKAGE_COLUMNS)}, nor facades with "
            f"id and {IS_FACADE_COLUMN}; give one that `export --format gpkg` wrote"
        )
    return found


def _row_annotations(row: JsonObject, names: Mapping[str, str]) -> Iterable[Annotation]:
    cells = {name: value for name, value in row.items() if value == value}  # empty numeric cells are NaN
    if cells.get(IS_FACADE_COLUMN) in (0, 1):  # some programs have no booleans
        cells[IS_FACADE_COLUMN] = bool(cells[IS_FACADE_COLUMN])
    id = cells.get("id")
    return _building_annotations("" if id is None else str(id), cells, names)


def _parse_cityjson(document: JsonObject) -> Iterator[Annotation]:
    """Yield the annotations of building attributes, and of walls that are marked as facades."""
    for id, city_object in document.get("CityObjects", {}).items():
        if city_object["type"] not in ("Building", "BuildingPart"):
            continue
        attributes = city_object.get("attributes", {})
        yield from _building_annotations(id, attributes, CITYJSON_ATTRIBUTES)
        if attributes.get("measuredHeight") not in (None, ""):
            names = ("measuredHeight", EXPORTED_HEIGHT_ATTRIBUTE, "eavesHeight")
            yield id, MEASURED_HEIGHT, CityJsonHeights(*map(attributes.get, names))
        is_facade: JsonObject = {}
        for geometry in city_object.get("geometry", ()):
            for surface in geometry.get("semantics", {}).get("surfaces", ()):
                # an edit of one surface counts for the whole wall
                if surface.get("isFacade", True) is not True:
                    is_facade[surface["facade"]] = surface["isFacade"]
                elif "facade" in surface and "isFacade" in surface:
                    is_facade.setdefault(surface["facade"], True)
        for facade, value in is_facade.items():
            yield facade, "facade", value


def _building_annotations(id: str, row: Mapping[str, object], names: Mapping[str, str]) -> Iterator[Annotation]:
    """Yield the annotations of a row by the names of its columns; empty cells have none."""
    for name, what in names.items():
        value = row.get(name)
        if value is not None and not (isinstance(value, str) and not value.strip()):
            yield id, what, value.item() if hasattr(value, "item") else value


def facades_by_picture_name(ids: list[str]) -> dict[str, str]:
    """Return the facade id by the name, without suffix, of its exported picture."""
    return {safe_file_stem(id): id for id in ids}
