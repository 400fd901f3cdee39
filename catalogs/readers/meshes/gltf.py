"""Reader of glTF (.glb, .gltf), converted to z up.

Names and picture files are read from the header; trimesh decodes geometry and transforms.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from catalogs.features import Remark
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.meshes.gltf_materials import (
    BaseColourTexture,
    base_colour,
    base_colour_texture,
    check_extensions,
    decode_normalized,
    exceeds_picture,
    header_item,
    stated_frame,
)
from catalogs.readers.meshes.surfaces import (
    MeshContent,
    MeshSurface,
    is_interior_class,
    is_surface_name,
    semantic_from_names,
)
from catalogs.readers.meshes.up_axis import Z_UP_FROM_Y_UP, note_sideways_gltf
from catalogs.readers.referenced_files import (
    NO_FILE_REASON,
    OUTSIDE_FOLDER_REASON,
    find_referenced_file,
    unread_file_reason,
)
from catalogs.readers.settings import LIMITS, MODELS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import MAX_MODEL_BYTES, read_regular

if TYPE_CHECKING:
    from trimesh import Trimesh

OTHER_SCENES_REASON = (
    "scenes of glTF files: the default one read, or the first; export the others as files of their own"
)
_EMBEDDED_REASON = (
    "models whose pictures are inside the glTF file, of another format or absent: read without; save the pictures as PNG, "
    "JPEG or WebP beside it"
)
_UNPLACED_REASON = "models whose pictures have no texture coordinates: read without"
_NO_FACES_REASON = "models whose points and lines are not read"
_MULTIPLIED_REASON = "models whose pictures are to be multiplied by a colour (baseColorFactor): read without it"
_VERTEX_COLOUR_REASON = "models with a colour at each vertex (COLOR_0): read without it; bake it into a picture"
_UNREPEATED_REASON = "models whose pictures end or are mirrored at their borders (sampler): repeated there"
_REPEATED_REASON = "buildings of {file} numbered since another has their id"
# In the order of the remarks.
_SCENE_REASONS = (
    _EMBEDDED_REASON,
    _UNPLACED_REASON,
    _NO_FACES_REASON,
    _MULTIPLIED_REASON,
    _VERTEX_COLOUR_REASON,
    _UNREPEATED_REASON,
    OUTSIDE_FOLDER_REASON,
    NO_FILE_REASON,
    _REPEATED_REASON,
)
# Number of a node, number of its mesh, and one primitive of that.
_Primitive: TypeAlias = tuple[int, int, JsonObject]
_PLACEHOLDER_NAMES = frozenset(("", "world", "scene", "root", "rootnode"))


def read_gltf_surfaces(path: Path) -> MeshContent:
    """Read surfaces by building and semantic, the pictures that they use, remarks, and the frame that the extras state.

    Coordinates (x, y, z) become (x, -z, y) plus `origin` [x, y, z] of the scene's extras. Embedded pictures are dropped, since
    textures are files.

    Raises
    ------
    InputError
        Where the file is no glTF with triangles.
    """
    with wrap_reader_errors(path, "cannot be read as glTF 2", "export it again"):
        header, rest = _split_header(path)
        check_extensions(path, header)
        return _read_scene(path, header, rest)


def _read_scene(path: Path, header: JsonObject, rest: bytes) -> MeshContent:
    import trimesh

    _check_counts(path, header)
    numbered, primitives = _split_primitives(header)
    scene = trimesh.load(
        io.BytesIO(_pack_glb(numbered, rest) if path.suffix.lower() == ".glb" else json.dumps(numbered).encode()),
        file_type=path.suffix.lower()[1:],
        resolver=_read_buffers(path, header),
        force="scene",
        process=False,
    )
    assert isinstance(scene, trimesh.Scene)
    origin = np.asarray(scene.metadata.get("origin", (0.0, 0.0, 0.0)), np.float64)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise InputError(f"{path}: the scene's extras state the origin {origin.tolist()}; give three numbers")
    reader = _SceneReader(path, header)
    surfaces: list[MeshSurface] = []
    for node in sorted(scene.graph.nodes_geometry, key=int):
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
            reader.note(_NO_FACES_REASON, _building_name(reader.names(primitives[int(node)])))
        elif (surface := reader.read_surface(mesh, primitives[int(node)])) is not None:
            vertices = (surface.corners @ transform[:3, :3].T + transform[:3, 3]) @ Z_UP_FROM_Y_UP.T + origin
            surfaces.append(replace(surface, corners=vertices[mesh.faces]))
    remarks = [*reader.remarks(), *note_sideways_gltf(surfaces, path.name)]
    return MeshContent(surfaces, tuple(reader.pictures), remarks, crs=stated_frame(header))


class _SceneReader:
    """Surfaces of the primitives of a glTF, their pictures, and a list of unread parts."""

    def __init__(self, path: Path, header: JsonObject) -> None:
        self.path, self.header = path, header
        self.pictures: list[Path] = []
        nodes = enumerate(header["nodes"])
        self._parents = {child: index for index, node in nodes for child in node.get("children", [])}
        self._drawn: dict[
            tuple[str, int], dict[int, int]
        ] = {}  # number of each node that draws one mesh under one name
        self._notes: dict[str, set[str]] = {reason: set() for reason in _SCENE_REASONS}

    def names(self, place: _Primitive) -> list[str]:
        """Return the names of a primitive: of its node and those above it, and of its mesh."""
        owner, mesh_index, _ = place
        return _primitive_names(self.header, owner, mesh_index, self._parents)

    def note(self, reason: str, name: str | None) -> None:
        """Note a building, or the file, for a reason."""
        self._notes[reason].add(name or self.path.stem)

    def read_surface(self, mesh: Trimesh, place: _Primitive) -> MeshSurface | None:
        """Return the surface of a primitive, its corners (n, 3) per vertex; None for an interior."""
        names, primitive = self.names(place), place[2]
        if names and is_interior_class(names[0].partition("|")[2] or names[0]):
            return None
        material = header_item(self.header, "materials", primitive.get("material"))
        building = self._number_building(_building_name(names), place)
        texture = base_colour_texture(self.header, material)
        picture = self._find_picture(texture, building)
        uv = None if picture is None else self._read_uv(mesh, primitive, texture, building)
        colour = base_colour(material)
        if uv is not None and colour is not None:
            self.note(_MULTIPLIED_REASON, building)
        elif "COLOR_0" in primitive["attributes"]:
            self.note(_VERTEX_COLOUR_REASON, building)
        surface = MeshSurface(
            building=building,
            semantic=semantic_from_names(*map(_surface_kind, names), material.get("name")),
            corners=decode_normalized(self.header, primitive["attributes"]["POSITION"], mesh.vertices),
            colour=colour,
        )
        if picture is None or uv is None:
            return surface
        uv = (uv * (1.0, -1.0) + (0.0, 1.0))[mesh.faces]
        return replace(surface, texture=self.pictures.index(picture), uv=uv, colour=None)

    def remarks(self) -> list[Remark]:
        """Return the remarks on the file."""
        found = [
            Remark(name, reason.format(file=self.path.name), None)
            for reason, names in self._notes.items()
            for name in sorted(names)
        ]
        if len(scenes := self.header.get("scenes", [])) > 1:
            found.append(Remark(f"{len(scenes)} in {self.path.name}", OTHER_SCENES_REASON, None))
        return found

    def _number_building(self, building: str | None, place: _Primitive) -> str | None:
        """Return the name of a building, with a number for the second and further nodes that draw its mesh."""
        owner, mesh_index, _ = place
        if building is None or building not in _own_names(self.header, owner, mesh_index):
            return building
        owners = self._drawn.setdefault((building, mesh_index), {})
        if number := owners.setdefault(owner, len(owners)):
            building = f"{building}-{number + 1}"
            self.note(_REPEATED_REASON, building)
        return building

    def _find_picture(self, texture: BaseColourTexture | None, building: str | None) -> Path | None:
        uri = texture.uri if texture else None
        if uri is None:
            return None
        picture = find_referenced_file(self.path, uri)
        if picture is None:
            reason = unread_file_reason(self.path, uri)
            self.note(reason or _EMBEDDED_REASON, uri if reason else building)
        elif picture not in self.pictures:
            self.pictures.append(picture)
        return picture

    def _read_uv(
        self, mesh: Trimesh, primitive: JsonObject, texture: BaseColourTexture | None, building: str | None
    ) -> Float64Array | None:
        coordinates = mesh.vertex_attributes.get("_UV")
        if texture is None or coordinates is None:
            self.note(_UNPLACED_REASON, building)
            return None
        stored = primitive["attributes"][f"TEXCOORD_{texture.coordinate_set}"]
        uv = texture.apply_transform(decode_normalized(self.header, stored, np.asarray(coordinates)))
        if not texture.repeats and exceeds_picture(uv):
            self.note(_UNREPEATED_REASON, building)
        return uv


def _check_counts(path: Path, header: JsonObject) -> None:
    """Raise InputError where nodes draw too many triangles, or accessors have no data."""
    accessors, meshes, nodes = header.get("accessors", []), header.get("meshes", []), header.get("nodes", [])
    if any(
        "bufferView" not in accessor and accessor.get("count", 0) > MODELS.max_unbacked_count for accessor in accessors
    ):
        raise InputError(f"{path} has accessors of zeros without a bufferView; export it again")
    corners = [
        sum(
            accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
            for primitive in mesh["primitives"]
        )
        for mesh in meshes
    ]
    drawn = sum(corners[node["mesh"]] for node in nodes if "mesh" in node)
    if drawn > 3 * LIMITS.max_triangles or len(nodes) > MODELS.max_gltf_nodes:
        raise InputError(
            f"{path} draws {drawn // 3} triangles in {len(nodes)} nodes, more than {LIMITS.max_triangles} "
            f"or {MODELS.max_gltf_nodes}; cut it up"
        )


def _split_header(path: Path) -> tuple[JsonObject, bytes]:
    """Return the JSON of a file and, of a .glb, the chunks behind it."""
    data = read_regular(path, MAX_MODEL_BYTES)
    if path.suffix.lower() != ".glb":
        return json.loads(data), b""
    magic, version, _, length, kind = struct.unpack_from("<4sIII4s", data)
    if magic != b"glTF" or version != 2 or kind != b"JSON":
        raise InputError(f"{path} is no binary glTF 2; export it again as .glb")
    return json.loads(data[20 : 20 + length]), data[20 + length :]


def _pack_glb(header: JsonObject, rest: bytes) -> bytes:
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest


def _split_primitives(header: JsonObject) -> tuple[JsonObject, dict[int, tuple[int, int, JsonObject]]]:
    """Return a header with one numbered node per primitive, and the (node, mesh, primitive) of each number.

    trimesh renames nameless and repeated nodes, at random for meshes of several primitives, and decodes every picture. Numbers
    stay stable, and texture coordinates pass as an attribute of their own.
    """
    nodes = [_select(node, node.keys() - {"mesh"}) for node in header.get("nodes", [])]
    meshes: list[JsonObject] = []
    places = {}
    for index, mesh in enumerate(header.get("meshes", [])):
        places[index] = range(len(meshes), len(meshes) + len(mesh["primitives"]))
        for primitive in mesh["primitives"]:
            attributes = _select(primitive["attributes"], {"POSITION"})
            texture = base_colour_texture(header, header_item(header, "materials", primitive.get("material")))
            coordinate_set = f"TEXCOORD_{texture.coordinate_set}" if texture else ""
            if coordinate_set in primitive["attributes"]:
                attributes["_UV"] = primitive["attributes"][coordinate_set]
            kept = _select(primitive, {"indices", "mode"}) | {"attributes": attributes}
            meshes.append({"name": str(len(meshes)), "primitives": [kept]})
    drawn = {}
    for owner, node in enumerate(header.get("nodes", [])):
        if "mesh" in node:
            primitives = header["meshes"][node["mesh"]]["primitives"]
            for place, primitive in zip(places[node["mesh"]], primitives, strict=True):
                drawn[len(nodes)] = (owner, node["mesh"], primitive)
                nodes[owner]["children"] = [*nodes[owner].get("children", []), len(nodes)]
                nodes.append({"mesh": place})
    nodes = [node | {"name": str(index)} for index, node in enumerate(nodes)]
    left = {"images", "textures", "materials", "animations", "skins", "cameras", "extensionsUsed", "extensionsRequired"}
    return _select(header, header.keys() - left) | {"nodes": nodes, "meshes": meshes}, drawn


def _select(item: JsonObject, keys: Collection[str]) -> JsonObject:
    return {key: value for key, value in item.items() if key in keys}


def _primitive_names(header: JsonObject, owner: int, mesh: int, parents: dict[int, int]) -> list[str]:
    """Return the names of a primitive, nearest first: its node, the ancestors, its mesh.

    The mesh replaces a nameless node.
    """
    above: list[JsonObject] = []
    node = parents.get(owner)
    while node is not None and len(above) < len(parents):
        above.append(header["nodes"][node])
        node = parents.get(node)
    drawn = [header["nodes"][owner], header["meshes"][mesh]]
    own = str(drawn[0].get("name", "")).strip().lower()
    order = [drawn[1], *above] if own in _PLACEHOLDER_NAMES else [drawn[0], *above, drawn[1]]
    stated = [str(item.get("name", "")).strip() for item in order]
    return [name for name in stated if name.lower() not in _PLACEHOLDER_NAMES]


def _own_names(header: JsonObject, owner: int, mesh: int) -> set[str]:
    """Return the names of a node and its mesh, up to a |."""
    items = (header["nodes"][owner], header["meshes"][mesh])
    return {str(item.get("name", "")).partition("|")[0].strip() for item in items}


def _building_name(names: list[str]) -> str | None:
    """Return the first name that does not name a surface, up to a |."""
    for name in names:
        building = name.partition("|")[0].strip()
        if building and not is_surface_name(building):
            return building
    return None


def _surface_kind(name: str) -> str | None:
    """Return the part of a name that describes the surface."""
    return name.partition("|")[2] or (name if is_surface_name(name) else None)


def _read_buffers(path: Path, header: JsonObject) -> dict[str, bytes]:
    """Return the geometry buffers of a .gltf by URI.

    Raises
    ------
    InputError
        Where a buffer is missing.
    """
    found = {}
    for buffer in header.get("buffers", []):
        uri = buffer.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:"):
            file = find_referenced_file(path, uri)
            if file is None:
                is_outside = unread_file_reason(path, uri) == OUTSIDE_FOLDER_REASON
                where = "lies outside its folder" if is_outside else "is not there"
                raise InputError(f"{path}: its buffer {uri} {where}; copy it beside the model")
            found[uri] = read_regular(file, MAX_MODEL_BYTES)
    return found
