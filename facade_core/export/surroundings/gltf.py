"""Surroundings of a block in glTF: neighbours, and instances of street objects as nodes or EXT_mesh_gpu_instancing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import Float64Array, IntArray
from facade_core.core.json_types import JsonObject
from facade_core.core.street_objects import NO_OBJECTS, ObjectKind, PlacedObjects, heading_axes
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS, SurroundingMesh
from facade_core.export.models.buffers import (
    BYTE,
    ELEMENT_ARRAY_BUFFER,
    FLOAT,
    MAX_UNSIGNED_SHORT,
    UNSIGNED_BYTE,
    UNSIGNED_INT,
    UNSIGNED_SHORT,
    GlbBuffer,
)
from facade_core.export.models.glb import encode_glb, quantise_directions
from facade_core.export.models.textured_mesh import ModelFrame, to_y_up
from facade_core.export.surroundings.colours import surrounding_colours
from facade_core.export.surroundings.models import build_object_model, place_model

INSTANCING = "EXT_mesh_gpu_instancing"
QUANTISATION = "KHR_mesh_quantization"
UNLIT = "KHR_materials_unlit"
MAX_UNSIGNED_BYTE = 255


@dataclass(frozen=True, eq=False)
class InstanceTransforms:
    """Transforms of instances in glTF's frame.

    Attributes
    ----------
    translation : (n, 3) metres.
    rotation : (n, 4) unit quaternions, x, y, z, w.
    scale : (n, 3) factors.
    """

    translation: Float64Array
    rotation: Float64Array
    scale: Float64Array


def instance_transforms(
    placed: PlacedObjects, kind: ObjectKind, rows: IntArray, frame: ModelFrame
) -> InstanceTransforms:
    """Compute the transforms of objects (n,) of one kind in a model frame, y up."""
    ahead = frame.directions(heading_axes(placed.heading[rows])[:, 1])
    half = np.arctan2(-ahead[:, 0], -ahead[:, 2]) / 2
    zero = np.zeros(len(rows))
    factors = placed.size[rows] / kind.size
    return InstanceTransforms(
        frame.points(placed.position[rows]),
        np.column_stack([zero, np.sin(half), zero, np.cos(half)]),
        factors[:, [0, 2, 1]],
    )


@dataclass(frozen=True)
class SurroundingModel:
    """Surroundings that are added to a glTF document: objects of the street, and what lies around the block.

    Attributes
    ----------
    placed : the objects.
    around : buildings and ground around the block.
    frame : frame of the model.
    is_unlit : their material shows its colours without light.
    is_instanced : one node for each model, by EXT_mesh_gpu_instancing; else one for each object, which every reader knows.
    """

    placed: PlacedObjects
    around: SurroundingMesh
    frame: ModelFrame
    is_unlit: bool = True
    is_instanced: bool = False

    @property
    def is_empty(self) -> bool:
        """Return whether there is nothing around."""
        return not (len(self.placed) or len(self.around))

    @property
    def objects_alone(self) -> SurroundingModel:
        """Return the model without what lies around the block."""
        return replace(self, around=NO_SURROUNDINGS)

    @property
    def neighbours_alone(self) -> SurroundingModel:
        """Return the model without objects."""
        return replace(self, placed=NO_OBJECTS)

    @property
    def parts(self) -> int:
        """Return how many of both, objects and neighbours, there are."""
        return bool(len(self.around)) + bool(len(self.placed))

    @property
    def draw_calls(self) -> int:
        """Return the number of draw calls, of instances that are drawn together."""
        return bool(len(self.around)) + len(list(self.placed.rows_by_model()))

    def points(self) -> Float64Array:
        """Return all points (n, 3) of the model in its frame, y up."""
        found = [self.around.vertices]
        for kind, variant, rows in self.placed.rows_by_model():
            model = build_object_model(kind, variant)
            found.append(place_model(model, self.placed, kind, rows).reshape(-1, 3))
        return self.frame.points(np.concatenate(found))

    def append(self, document: JsonObject, buffer: GlbBuffer) -> None:
        """Add the surroundings to a document and its buffer."""
        if self.is_empty:
            return
        lists = {name: document.setdefault(name, []) for name in ("materials", "meshes", "nodes")}
        scene = document["scenes"][0]
        lists["materials"].append(_material(self.is_unlit))
        material = len(lists["materials"]) - 1
        first = len(lists["nodes"])
        if len(self.around):
            around, frame = self.around, self.frame
            values = frame.points(around.vertices), frame.directions(around.normal), surrounding_colours(around)
            shape = self._add_primitive(buffer, values, around.triangles, material)
            lists["meshes"].append({"primitives": [shape]})
            lists["nodes"].append({"name": "neighbours", "mesh": len(lists["meshes"]) - 1})
        for kind, variant, rows in self.placed.rows_by_model():
            name = f"{kind.name}-{variant}" if kind.variants > 1 else kind.name
            model = build_object_model(kind, variant)
            values = to_y_up(model.position), to_y_up(model.normal), model.colour
            shape = self._add_primitive(buffer, values, model.triangles, material)
            lists["meshes"].append({"name": name, "primitives": [shape]})
            transforms = instance_transforms(self.placed, kind, rows, self.frame)
            number = len(lists["meshes"]) - 1
            if self.is_instanced:
                lists["nodes"].append({"name": name, "mesh": number, "extensions": _instancing(transforms, buffer)})
            else:
                for row, own in zip(rows.tolist(), _rows(transforms), strict=True):
                    node = {"name": f"{kind.name} {self.placed.id[row]}", "mesh": number}
                    node |= {key: part.tolist() for key, part in own.items()}
                    lists["nodes"].append(node if self.placed.is_stated[row] else node | {"extras": {"stated": False}})
        scene["nodes"] = [*scene.get("nodes", ()), *range(first, len(lists["nodes"]))]
        self._add_extensions(document)

    def _add_primitive(
        self,
        buffer: GlbBuffer,
        values: tuple[Float64Array, Float64Array, Float64Array],
        triangles: IntArray,
        material: int,
    ) -> JsonObject:
        """Add a primitive of positions, normals, both y up, and linear colours (v, 3); unlit ones have no normals."""
        # equal corners are one vertex: most of the ground, and of unlit models
        rows = np.column_stack([values[0].round(3), np.round(values[2] * MAX_UNSIGNED_BYTE), values[1].round(2)])
        _, first, number = np.unique(
            rows[:, : 6 if self.is_unlit else 9], axis=0, return_index=True, return_inverse=True
        )
        position, colour = rows[first, :3].astype("<f4"), rows[first, 3:6].astype("u1")
        triangles = number.reshape(-1)[triangles]
        bounds = {"min": position.min(axis=0).tolist(), "max": position.max(axis=0).tolist()}
        attributes = {"POSITION": buffer.add_accessor(position, FLOAT, "VEC3", **bounds)}
        if not self.is_unlit:
            normal = quantise_directions(values[1][first])
            attributes["NORMAL"] = buffer.add_accessor(normal, BYTE, "VEC3", normalized=True)
        attributes["COLOR_0"] = buffer.add_accessor(colour, UNSIGNED_BYTE, "VEC3", normalized=True)
        is_wide = len(position) > MAX_UNSIGNED_SHORT
        indices = triangles.astype("<u4" if is_wide else "<u2").reshape(-1, 1)
        component = UNSIGNED_INT if is_wide else UNSIGNED_SHORT
        index = buffer.add_accessor(indices, component, "SCALAR", target=ELEMENT_ARRAY_BUFFER)
        return {"attributes": attributes, "indices": index, "material": material}

    def _add_extensions(self, document: JsonObject) -> None:
        required = [*([] if self.is_unlit else [QUANTISATION]), *([INSTANCING] if self.is_instanced else [])]
        used = [*([UNLIT] if self.is_unlit else []), *required]
        for name, more in (("extensionsUsed", used), ("extensionsRequired", required)):
            if more:
                document[name] = list(dict.fromkeys([*document.get(name, ()), *more]))


def encode_surroundings_glb(model: SurroundingModel, extras: Mapping[str, object], copyright: str) -> bytes:
    """Encode surroundings alone as GLB."""
    return encode_glb((), (), extras=extras, copyright=copyright, append=model.append)


def _rows(transforms: InstanceTransforms) -> list[dict[str, Float64Array]]:
    parts = (("translation", 3), ("rotation", 6), ("scale", 4))
    rounded = {name: np.round(getattr(transforms, name), digits) for name, digits in parts}
    return [{name: values[row] for name, values in rounded.items()} for row in range(len(transforms.translation))]


def _instancing(transforms: InstanceTransforms, buffer: GlbBuffer) -> JsonObject:
    """Return the extension of a node with the attributes of its instances."""
    attributes = {}
    for name, kind in (("translation", "VEC3"), ("rotation", "VEC4"), ("scale", "VEC3")):
        values = getattr(transforms, name).astype("<f4")
        attributes[name.upper()] = buffer.add_accessor(values, FLOAT, kind)
    return {INSTANCING: {"attributes": attributes}}


def _material(is_unlit: bool) -> JsonObject:
    """Return the material of all surroundings: the colours of vertices."""
    surface = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    material: JsonObject = {"name": "surroundings", "pbrMetallicRoughness": surface}
    return material | ({"extensions": {UNLIT: {}}} if is_unlit else {})
