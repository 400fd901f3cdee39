"""Buildings of CityJSON 1.0, 1.1 and 2.0 files and sequences: shells with semantics and textures."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
import shapely

from catalogs.features import BuildingModel, BuildingModels, Fault, Remark, make_unique_id
from catalogs.reader_errors import fault_reason
from catalogs.readers.axes import CoordinateAxes, resolve_crs_axes
from catalogs.readers.cityjson.parts import (
    Lod,
    format_lod,
    group_building_objects,
    is_of_building,
    parse_lod,
    select_lod_geometries,
)
from catalogs.readers.cityjson.surfaces import CityJsonAppearance, extract_faces, instantiate_geometry_template
from catalogs.readers.cityjson.values import (
    apply_transform,
    list_or_empty,
    mapping_or_empty,
    parse_number,
    parse_points,
)
from catalogs.readers.faces import PlanarFace, have_equal_extents, newell_normal, triangulate_faces
from catalogs.readers.json_text import is_json_lines, load_json, parse_json
from catalogs.readers.material_colours import choose_finish, parse_colour_shares
from catalogs.readers.referenced_files import find_referenced_file, unread_file_reason
from catalogs.readers.settings import MODELS
from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.core.errors import GeometryError, InputError
from facade_core.core.json_types import JsonObject, JsonValue
from facade_core.core.regular_files import open_regular

_VERSION = re.compile(r"(1\.0|1\.1|2\.0)(\.\d+)?")
# Attributes of the name of a building, in order of preference, in lower case.
_NAME_ATTRIBUTES = ("name", "gml_name", "gml:name", "building_name", "bezeichnung", "naam", "nom")


@dataclass(slots=True)
class _ReaderState:
    """Head of a file and the results so far.

    pictures: index by path as written; other_types: objects that are no part of a building, by type.
    """

    path: Path
    requested_lod: Lod | None
    head: JsonObject
    axes: CoordinateAxes | None = None
    pictures: dict[str, int] = field(default_factory=dict)
    ids: Counter[str] = field(default_factory=Counter)
    other_types: Counter[str] = field(default_factory=Counter)
    models: list[BuildingModel] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)


def read_cityjson(path: Path, lod: str | None = None) -> BuildingModels:
    """Read all buildings of a CityJSON file or CityJSONSeq in file order.

    Parts and installations are included. A sequence is read line by line.

    Parameters
    ----------
    path : file.
    lod : "2.2", or "2" for the highest of 2.x, else the nearest lower level of a building, else the nearest higher; None for
        the highest of each.

    Raises
    ------
    InputError
        Where the file is no CityJSON of a supported version.
    """
    if not is_json_lines(path):
        return parse_cityjson(load_json(path), path, lod)
    reading = None
    try:
        with open_regular(path) as lines:
            for number, line in enumerate(lines, 1):
                if not line.strip():
                    continue
                if reading is None:
                    reading = _check_head(parse_json(line, f"{path}, line {number}"), path, lod, sequence=True)
                    _read_document(reading.head, reading)
                else:
                    _read_line(line, number, reading)
    except OSError as error:
        raise InputError(f"{path} cannot be opened ({error.strerror}); check the path") from error
    if reading is None:
        raise InputError(f"{path} is empty; get the file again")
    return _collect_models(reading)


def parse_cityjson(document: JsonValue, path: Path, lod: str | None = None) -> BuildingModels:
    """Return the buildings of a parsed document, as read_cityjson does.

    Parameters
    ----------
    document : parsed JSON.
    path : file of the document, next to which textures are searched.
    lod : level of detail, as in read_cityjson.
    """
    reading = _check_head(document, path, lod)
    _read_document(reading.head, reading)
    return _collect_models(reading)


def _check_head(head: JsonValue, path: Path, lod: str | None, *, sequence: bool = False) -> _ReaderState:
    asked = None if lod is None else parse_lod(lod)
    if asked is not None and not (asked and asked[0] > 0):
        raise InputError(f"{path}: LoD {lod!r} is not a level of models; give one such as 1, 2 or 2.2")
    kind = head.get("type") if isinstance(head, dict) else None
    if kind == "CityJSONFeature":
        raise InputError(
            f"{path} begins with a feature; a CityJSONSeq needs a first line of type CityJSON with its transform"
        )
    if not isinstance(head, dict) or kind != "CityJSON":
        raise InputError(f"{path} is not CityJSON: its type is {kind!r}; export it as CityJSON")
    version = str(head.get("version"))
    if not _VERSION.fullmatch(version):
        raise InputError(f"{path} is CityJSON {version}; 1.0, 1.1 and 2.0 are read: upgrade it, e.g. with cjio")
    if not sequence and not (isinstance(head.get("CityObjects"), dict) and isinstance(head.get("vertices"), list)):
        raise InputError(f"{path} has no CityObjects or no vertices; export it anew")
    transform = head.get("transform")
    if transform is None and sequence:
        raise InputError(f"{path} has no transform in its first line, which every feature needs; export it anew")
    numbers = parse_points([mapping_or_empty(transform).get(key) for key in ("scale", "translate")])
    if transform is not None and not np.isfinite(numbers).all():
        raise InputError(f"{path}: its transform is not a scale and a translate of three numbers each; export it anew")
    return _ReaderState(path, asked, head)


def _read_line(line: bytes, number: int, reading: _ReaderState) -> None:
    """Read one feature of a sequence; a broken one becomes a fault."""
    try:
        document = parse_json(line, f"{reading.path.name}, line {number}")
    except InputError as error:
        reading.faults.append(Fault(f"line {number}", "building", str(error)))
        return
    kind = document.get("type") if isinstance(document, dict) else None
    if kind == "CityJSON":
        raise InputError(f"{reading.path}: line {number} begins a second sequence; split the file there")
    if not isinstance(document, dict) or kind != "CityJSONFeature" or not isinstance(document.get("CityObjects"), dict):
        reason = f"{reading.path.name}, line {number} is no CityJSONFeature with CityObjects; export it anew"
        reading.faults.append(Fault(f"line {number}", "building", reason))
        return
    _read_document(document, reading)


def _read_document(document: JsonObject, reading: _ReaderState) -> None:
    """Read the buildings of a file, or of one feature of a sequence."""
    corners = apply_transform(parse_points(document.get("vertices")), reading.head.get("transform"))
    reading.axes = axes = reading.axes or _document_axes(corners, reading)
    points = axes.to_east_north_up(corners) if axes else corners
    store = mapping_or_empty(reading.head.get("geometry-templates"))
    templates = list_or_empty(store.get("templates"))
    template_points = parse_points(store.get("vertices-templates"))
    appearance = _read_appearance(document, reading)

    def place_faces(geometry: JsonObject) -> list[PlanarFace]:
        if geometry["type"] != "GeometryInstance":
            return extract_faces(geometry, points, appearance)
        moved = instantiate_geometry_template(geometry, template_points, corners)
        return extract_faces(
            mapping_or_empty(templates[geometry["template"]]),
            axes.to_east_north_up(moved) if axes else moved,
            appearance,
        )

    objects: dict[str, JsonObject] = {}
    for id, thing in mapping_or_empty(document.get("CityObjects")).items():
        if isinstance(thing, dict):
            objects[id] = thing
            if not is_of_building(thing):
                reading.other_types[str(thing.get("type"))[: MODELS.max_type_name_length]] += 1
        else:
            reading.faults.append(Fault(id, "building", f"{reading.path.name}: it is no CityObject; export it anew"))
    for root, ids in group_building_objects(objects):
        id = make_unique_id(root, reading.ids, reading.remarks, reading.path)
        try:
            pieces, other = select_lod_geometries(ids, objects, templates, reading.requested_lod)
            faces_by_piece = [
                (id, _merge_geometries([place_faces(g) for g in _sort_richest_first(geometries)]))
                for id, geometries in pieces
            ]
            faces = _join_pieces(faces_by_piece, root, objects)
            model = _build_model(id, faces, [objects[i] for i in ids], axes or CoordinateAxes(), reading.remarks)
        except Exception as error:  # the other buildings are read
            place = _bounding_box([objects[i] for i in ids], points) if isinstance(error, GeometryError) else None
            reading.faults.append(Fault(id, "building", f"{reading.path.name}: {fault_reason(error)}", place))
            continue
        reading.models.append(model)
        if other is not None and reading.requested_lod is not None:
            asked = format_lod(reading.requested_lod)
            outline = shapely.box(*model.shell.vertices[:, :2].min(axis=0), *model.shell.vertices[:, :2].max(axis=0))
            reading.remarks.append(
                Remark(id, f"buildings without LoD {asked} read at LoD {format_lod(other)}", outline)
            )


def _join_pieces(
    pieces: Sequence[tuple[str, Sequence[PlanarFace]]], root: str, objects: Mapping[str, JsonObject]
) -> list[PlanarFace]:
    """Return the faces of the objects of a building, without a solid of its own that is the hull of its parts."""
    corners: dict[bool, list[Float64Array]] = {True: [np.zeros((0, 3))], False: [np.zeros((0, 3))]}
    for id, faces in pieces:
        if id == root or objects[id].get("type") == "BuildingPart":
            corners[id == root] += chain.from_iterable(face.rings for face in faces)
    is_hull = have_equal_extents(np.concatenate(corners[True]), np.concatenate(corners[False]))
    return [face for id, faces in pieces if not (is_hull and id == root) for face in faces]


def _build_model(
    id: str, faces: Sequence[PlanarFace], things: Sequence[JsonObject], axes: CoordinateAxes, remarks: list[Remark]
) -> BuildingModel:
    shell = triangulate_faces(faces, axes.metres_per_unit)
    if shell is None:
        raise GeometryError("its surfaces enclose no area; repair or remove it")
    if np.ptp(shell.vertices[:, 2]) < MODELS.min_model_height_m:
        raise GeometryError("all of it lies at one height; give a model with walls, or footprints with heights")
    attributes = [mapping_or_empty(thing.get("attributes")) for thing in things]

    def stated(key: str, low: float, high: float, unit: float = 1.0) -> list[float]:
        """Return the building's own number, else those of its parts."""
        numbers = [parse_number(attribute.get(key)) * unit for attribute in attributes]
        fit = [number for number in numbers if low < number < high]
        return numbers[:1] if numbers[0] in fit else fit

    heights = stated("measuredHeight", 0.0, MODELS.max_stated_height_m, axes.metres_per_height_unit)
    bases = stated(
        "TerrainHeight", -MODELS.max_ground_height_m, MODELS.max_ground_height_m, axes.metres_per_height_unit
    )
    coloured = [
        (face.semantic, newell_normal(face.rings[0] * (*axes.metres_per_unit, 1.0))[None], face.colour)
        for face in faces
        if face.colour is not None and face.texture < 0 and face.rings
    ]
    return BuildingModel(
        id,
        shell,
        height=max(heights, default=None),
        levels=max(stated("storeysAboveGround", 0.0, MODELS.max_levels), default=None),
        name=_stated_name(attributes[0]),
        base=min(bases, default=None),
        finish=choose_finish(coloured, id, remarks),
    )


def _sort_richest_first(geometries: Sequence[JsonObject]) -> list[JsonObject]:
    """Return the geometries of one object and level, those with textures and semantics first."""
    return sorted(geometries, key=lambda g: (not g.get("texture"), not g.get("semantics")))


def _merge_geometries(geometries: Sequence[list[PlanarFace]]) -> list[PlanarFace]:
    """Return the faces of all geometries without repetitions, since a solid may repeat its surfaces."""
    faces = list(geometries[0])
    known: set[bytes] = set()
    for before, after in pairwise(geometries):
        known |= {_face_key(face) for face in before}
        faces += [face for face in after if _face_key(face) not in known]
    return faces


def _face_key(face: PlanarFace) -> bytes:
    return np.unique(face.rings[0], axis=0).tobytes() if face.rings else b""


def _document_axes(corners: Float64Array, reading: _ReaderState) -> CoordinateAxes | None:
    """Return the axes of the coordinates; None while no finite point decides on them."""
    finite = corners[np.isfinite(corners).all(axis=1)]
    if len(finite) == 0:
        return None
    first, second = np.median(finite[:, :2], axis=0).tolist()
    name = _reference_system(reading)
    axes, remark = resolve_crs_axes(name, (first, second), reading.path)
    if remark:
        reading.remarks.append(Remark(f"{name} of {reading.path.name}", remark, None))
    return axes


def _reference_system(reading: _ReaderState) -> str | None:
    name = mapping_or_empty(reading.head.get("metadata")).get("referenceSystem")
    return str(name) if isinstance(name, str | int) else None


def _read_appearance(document: JsonObject, reading: _ReaderState) -> CityJsonAppearance:
    """Return the pictures of a document, or of the head where it has none."""
    stated = mapping_or_empty(document.get("appearance") or reading.head.get("appearance"))
    images = [mapping_or_empty(texture).get("image") for texture in list_or_empty(stated.get("textures"))]
    numbers = [
        reading.pictures.setdefault(image, len(reading.pictures)) if isinstance(image, str) and image else -1
        for image in images
    ]
    materials = list_or_empty(stated.get("materials"))
    colours = [parse_colour_shares(mapping_or_empty(material).get("diffuseColor")) for material in materials]
    themes = (stated.get("default-theme-texture"), stated.get("default-theme-material"))
    textures_theme, materials_theme = (theme if isinstance(theme, str) else None for theme in themes)
    return CityJsonAppearance(
        parse_points(stated.get("vertices-texture"), 2), numbers, textures_theme, colours, materials_theme
    )


def _stated_name(attributes: JsonObject) -> str | None:
    own = {key.lower(): value for key, value in attributes.items()}
    names = [own.get(key) for key in _NAME_ATTRIBUTES]
    return next((name.strip() for name in names if isinstance(name, str) and name.strip()), None)


def _find_pictures(reading: _ReaderState, used: Collection[int]) -> tuple[dict[Path, int], Int32Array]:
    """Return the number of each picture that is used and exists, and that by its number in the file, -1 without."""
    found: dict[Path, int] = {}
    numbers = np.full(len(reading.pictures) + 1, -1, np.int32)  # index -1 maps to -1
    missing = 0
    for image, number in reading.pictures.items():
        if number in used:
            path = find_referenced_file(reading.path, image)
            if path is not None:
                numbers[number] = found.setdefault(path, len(found))
            elif reason := unread_file_reason(reading.path, image):
                reading.remarks.append(Remark(image, reason, None))
            else:
                missing += 1
    if missing:
        reason = f"files read without {missing} of their {len(used)} texture images, which are missing"
        reading.remarks.append(Remark(reading.path.name, reason, None))
    return found, numbers


def _collect_models(reading: _ReaderState) -> BuildingModels:
    """Return all models with the pictures that are used and exist."""
    used = {int(number) for model in reading.models for number in np.unique(model.shell.texture)} - {-1}
    pictures, numbers = _find_pictures(reading, used)
    reading.remarks += [
        Remark(f"{count} {kind} of {reading.path.name}", "kinds of objects that are no buildings left out", None)
        for kind, count in sorted(reading.other_types.items())
    ]
    models = []
    for model in reading.models:
        texture = numbers[model.shell.texture]
        uv = np.where(texture[:, None, None] >= 0, model.shell.uv, np.float32(0))
        models.append(replace(model, shell=replace(model.shell, texture=texture, uv=uv)))
    axes = reading.axes or resolve_crs_axes(_reference_system(reading), None, reading.path)[0]
    return BuildingModels(axes.crs, tuple(models), tuple(pictures), tuple(reading.remarks), tuple(reading.faults))


def _bounding_box(things: Sequence[JsonObject], points: Float64Array) -> shapely.Polygon | None:
    """Return the box around the readable corners of a broken building."""
    stack: list[object] = [thing.get("geometry") for thing in things]
    index = set()
    while stack:
        entry = stack.pop()
        if isinstance(entry, dict):
            stack.append(entry.get("boundaries"))
        elif isinstance(entry, list):
            stack += entry
        elif type(entry) is int and 0 <= entry < len(points):
            index.add(entry)
    corners = points[sorted(index)]
    corners = corners[np.isfinite(corners).all(axis=1), :2]
    return shapely.box(*corners.min(axis=0), *corners.max(axis=0)) if len(corners) else None
