"""Reader of Wavefront OBJ with groups, objects, materials, polygons and texture files."""

from __future__ import annotations

import io
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from catalogs.features import Fault, Remark
from catalogs.printable_text import normal_form
from catalogs.readers.faces import PlanarFace, triangulate_faces
from catalogs.readers.material_colours import parse_colour_shares
from catalogs.readers.meshes.material_options import TexturePlacement, parse_texture_statement
from catalogs.readers.meshes.surfaces import (
    MeshContent,
    MeshSurface,
    is_interior_class,
    is_surface_name,
    semantic_from_names,
)
from catalogs.readers.referenced_files import OUTSIDE_FOLDER_REASON, find_referenced_file, unread_file_reason
from catalogs.readers.settings import LIMITS
from catalogs.readers.vectors.colours import Colour
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

# Statements whose operand is a name up to the end of the line.
_NAME_KEYS = ("o ", "g ", "usemtl ", "mtllib ")

_PLACEHOLDER_NAMES = ("", "default", "(null)", "off")
_MAX_INDEX = 2**62
# Pictures of a material: of its colour, else of its ambient colour or of its own light.
_PICTURE_KEYS = ("map_kd", "map_ka", "map_ke")
VERTEX_COLOUR_REASON = "OBJ files with a colour at each vertex: read without it; state Kd of materials, or export PLY"

FaceLabel = tuple[str | None, str | None, str | None]  # object, group, material
# building, semantic, texture and its placement, colour
SurfaceKey = tuple[str | None, str, int, TexturePlacement, Colour | None]


@dataclass(slots=True)
class _ObjContent:
    """Content of the lines of a file.

    Attributes
    ----------
    sizes, label : number of corners and label of each face.
    vertex, coordinate : 0-based index of each corner of each face, -1 without.
    """

    vertices: array[float] = field(default_factory=lambda: array("d"))
    coordinates: array[float] = field(default_factory=lambda: array("d"))
    sizes: array[int] = field(default_factory=lambda: array("i"))
    label: array[int] = field(default_factory=lambda: array("i"))
    vertex: array[int] = field(default_factory=lambda: array("q"))
    coordinate: array[int] = field(default_factory=lambda: array("q"))
    labels: dict[FaceLabel, int] = field(default_factory=dict)
    declared: set[FaceLabel] = field(default_factory=set)
    libraries: list[str] = field(default_factory=list)
    has_vertex_colours: bool = False

    def add_face(self, words: Sequence[str], label: FaceLabel) -> None:
        """Add a face by the words of its corners; lines and points are none."""
        if len(words) < 3:
            return
        self.sizes.append(len(words))
        self.label.append(self.labels.setdefault(label, len(self.labels)))
        for word in words:
            vertex, _, rest = word.partition("/")
            self.vertex.append(_parse_index(vertex, len(self.vertices) // 3))
            self.coordinate.append(_parse_index(rest.partition("/")[0], len(self.coordinates) // 2) if rest else -1)


@dataclass(slots=True)
class _Materials:
    """Existing picture (map_Kd) of each material with its placement, and the colours (Kd) of materials."""

    pictures: dict[str, tuple[Path, TexturePlacement]] = field(default_factory=dict)
    colours: dict[str, Colour] = field(default_factory=dict)
    remarks: list[Remark] = field(default_factory=list)

    def read_library(self, path: Path, file: Path) -> None:
        """Add the materials of a library of the model `path`."""
        material = ""
        for line in _logical_lines(file):
            key, _, value = line.strip().partition(" ")
            key = key.lower()
            if key == "newmtl":
                material = value.strip()
            elif key == "kd" and (colour := parse_colour_shares(_parse_floats(value.split()[:3], 3))):
                self.colours[material] = colour
            elif key == _PICTURE_KEYS[0] or (key in _PICTURE_KEYS and material not in self.pictures):
                self._add_picture(path, file, material, value)

    def _add_picture(self, path: Path, file: Path, material: str, statement: str) -> None:
        # options may precede the name; many exporters write an absolute folder
        stated, placement = parse_texture_statement(statement.replace("\\", "/"))
        names = [stated, *stated.split()[-1:]]
        found = [name for whole in names for name in (whole, *_ends_of_path(whole))]
        if picture := find_referenced_file(path, *found, folder=file.parent):
            self.pictures[material] = (picture, placement)
        else:
            reason = unread_file_reason(path, *names, folder=file.parent)
            self.remarks.append(Remark(stated, reason or "pictures named by materials but absent", None))


def read_obj_surfaces(path: Path) -> MeshContent:
    """Read surfaces by building and semantic, the pictures that they use, remarks and faults.

    Coordinates are those of the file.

    Raises
    ------
    InputError
        Where there is no face.
    """
    text = _parse_obj(path)
    if not text.labels:
        raise InputError(f"{path} holds no faces; export the model as polygons or triangles")
    materials = _read_material_libraries(path, text.libraries)
    textures = tuple(dict.fromkeys(picture for picture, _ in materials.pictures.values()))
    if text.has_vertex_colours:
        materials.remarks.append(Remark(path.name, VERTEX_COLOUR_REASON, None))

    objects = {label[0] for label in text.labels} - {None}
    by_object = len(objects) > 1 and not any("|" in (label[1] or "") for label in text.labels)
    kinds = [_surface_key(label, by_object, materials, textures) for label in text.labels]
    empty = _find_empty_buildings(text, by_object)
    faults = [Fault(name, "building", f"group {name} of {path.name} has no faces; give it some") for name in empty]
    return MeshContent(list(_build_surfaces(text, kinds)), textures, materials.remarks, faults)


def _find_empty_buildings(text: _ObjContent, by_object: bool) -> list[str]:
    named, declared = (
        {_building_name(label, by_object) for label in labels} for labels in (text.labels, text.declared)
    )
    return sorted(map(str, declared - named - {None}))


def _surface_key(
    label: FaceLabel, by_object: bool, materials: _Materials, textures: Sequence[Path]
) -> SurfaceKey | None:
    """Return the surface of a label; None for an interior."""
    _, group, material = label
    kind = (group or "").partition("|")[2]
    if is_interior_class(kind):
        return None
    semantic = semantic_from_names(kind, group if by_object or is_surface_name(group or "") else None, material)
    picture, placement = materials.pictures.get(material or "", (None, TexturePlacement()))
    texture = -1 if picture is None else textures.index(picture)
    colour = materials.colours.get(material or "") if picture is None else None
    return _building_name(label, by_object), semantic, texture, placement, colour


def _building_name(label: FaceLabel, by_object: bool) -> str | None:
    """Return the building of a label: a group's name up to a |, where groups name buildings."""
    object_name, group, _ = label
    names = (object_name,) if by_object else (group, object_name)
    for name in names:
        name = (name or "").partition("|")[0].strip()
        if name.lower() not in _PLACEHOLDER_NAMES and not is_surface_name(name):
            return name
    return None


def _parse_obj(path: Path) -> _ObjContent:
    text = _ObjContent()
    label: FaceLabel = (None, None, None)
    for line in _logical_lines(path):
        words = line.split()
        key = words[0] if words else ""
        if key == "v":
            text.vertices.extend(_parse_floats(words[1:4], 3))
            text.has_vertex_colours |= len(words) >= 7
        elif key == "f":
            text.add_face(words[1:], label)
        elif key == "vt":
            text.coordinates.extend(_parse_floats([*words[1:3], "0"][:2], 2))
        elif key in ("g", "o", "usemtl"):
            name = line.strip()[len(key) :].strip()
            object_name, group, material = label
            label = {"o": (name, None, material), "g": (object_name, name, material)}.get(
                key, (object_name, group, name)
            )
            if key != "usemtl":
                text.declared.add(label)
        elif key == "mtllib":
            text.libraries.append(line.strip()[6:].strip())
    return text


def _logical_lines(path: Path) -> Iterator[str]:
    """Yield the lines of a file, joined after a backslash, which in a name is a character like others."""
    start = ""
    with io.TextIOWrapper(open_regular(path), encoding="utf-8-sig", errors="replace") as file:
        for line in file:
            if line.endswith("\\\n") and (start or not line.lstrip().startswith(_NAME_KEYS)):
                start += line[:-2] + " "
            else:
                yield normal_form(start + line)
                start = ""


def _parse_floats(words: list[str], count: int) -> tuple[float, ...]:
    """Return the numbers of a vertex; all NaN where one is invalid, so that only its faces are lost."""
    try:
        numbers = tuple(map(float, words))
    except ValueError:
        numbers = ()
    return numbers if len(numbers) == count else (float("nan"),) * count


def _parse_index(word: str, count: int) -> int:
    """Return a 0-based index, -1 where it is invalid; negative ones count back from the latest."""
    try:
        index = int(word)
    except ValueError:
        return -1
    if abs(index) > _MAX_INDEX:
        return -1
    return index - 1 if index > 0 else max(count + index, -1) if index < 0 else -1


def _build_surfaces(text: _ObjContent, kinds: list[SurfaceKey | None]) -> Iterator[MeshSurface]:
    """Yield the faces of each label as triangles; labels without a key are skipped."""
    # a last row of NaN replaces missing vertices
    vertices = np.concatenate([np.frombuffer(text.vertices), [np.nan] * 3]).reshape(-1, 3)
    coordinates = np.concatenate([np.frombuffer(text.coordinates), [np.nan] * 2]).reshape(-1, 2)
    sizes = np.frombuffer(text.sizes, np.int32)
    starts = np.cumsum(sizes, dtype=np.int64) - sizes
    vertex = np.frombuffer(text.vertex, np.int64)
    vertex = np.where(vertex < len(vertices) - 1, vertex, -1)
    coordinate = np.frombuffer(text.coordinate, np.int64)
    coordinate = np.where(coordinate < len(coordinates) - 1, coordinate, -1)
    sound = np.logical_and.reduceat(np.isfinite(vertices).all(axis=1)[vertex], starts) & (sizes <= LIMITS.max_corners)

    label = np.frombuffer(text.label, np.int32)
    order = np.argsort(label, kind="stable")
    for faces in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
        kind = kinds[label[faces[0]]]
        if kind is None:
            continue
        building, semantic, texture, placement, colour = kind
        whole = faces[sound[faces]]
        triangles = starts[whole[sizes[whole] == 3], None] + np.arange(3)
        uv = None if texture < 0 else placement.apply(np.nan_to_num(coordinates[coordinate[triangles]]))
        yield MeshSurface(building, semantic, vertices[vertex[triangles]], texture, uv, colour)
        rings = [slice(starts[face], starts[face] + sizes[face]) for face in whole[sizes[whole] > 3]]
        polygons = [
            PlanarFace(
                [vertices[vertex[r]]], semantic, texture, [placement.apply(np.nan_to_num(coordinates[coordinate[r]]))]
            )
            for r in rings
        ]
        if polygons and (shell := triangulate_faces(polygons)) is not None:
            yield MeshSurface(building, semantic, shell.vertices[shell.triangles], texture, shell.uv, colour)
        if len(whole) < len(faces):  # one broken triangle per face marks the model as broken
            broken = vertices[vertex[starts[faces[~sound[faces]], None] + np.arange(3)]]
            broken[np.isfinite(broken).all(axis=(1, 2)), 0] = np.nan
            yield MeshSurface(building, semantic, broken)


def _ends_of_path(name: str) -> list[str]:
    """Return the ends of a path, the longest first: many exporters write the folder of another machine."""
    parts = Path(name).parts
    return ["/".join(parts[start:]) for start in range(1, len(parts))]


def _read_material_libraries(path: Path, libraries: list[str]) -> _Materials:
    materials = _Materials()
    for library in libraries:
        for name in [library] if find_referenced_file(path, library) else library.split():
            file = find_referenced_file(path, name)
            if file is None:
                is_outside = unread_file_reason(path, name) == OUTSIDE_FOLDER_REASON
                where = "outside the model's folder: not read" if is_outside else "but absent"
                materials.remarks.append(Remark(Path(name).name, f"material files named by the model {where}", None))
            else:
                materials.read_library(path, file)
    return materials
