"""Texture coordinates, pictures and extensions of glTF."""

from __future__ import annotations

import json
import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from catalogs.readers.meshes.gltf import OTHER_SCENES_REASON
from catalogs.readers.meshes.models import read_mesh_buildings
from catalogs.readers.meshes.surfaces import MeshSurface
from catalogs.readers.meshes.up_axis import Z_UP_FROM_Y_UP, Z_UP_GLTF_REASON, note_sideways_gltf
from catalogs.readers.referenced_files import NO_FILE_REASON
from facade_core.core.arrays import FloatArray
from facade_core.core.errors import InputError

SQUARE = ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 4.0, 0.0), (0.0, 4.0, 0.0))
UV = ((0.0, 1.0), (0.5, 1.0), (0.5, 0.5), (0.0, 0.5))  # v down
COMPONENTS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5126: "f"}


def write_wall(folder: Path, component: int = 5126, scale: float = 1.0, **keys: Any) -> Path:
    """Write a textured wall of 4 x 4 m whose texture coordinates are stored as `component`, times `scale`."""
    Image.new("RGB", (32, 32), (200, 60, 50)).save(folder / "wall.png")
    Image.new("RGB", (32, 32), (200, 60, 50)).save(folder / "wall.webp")
    size = struct.calcsize(COMPONENTS[component])
    stored = [tuple(scale * number if component == 5126 else round(scale * number) for number in one) for one in UV]
    pad = b"\0" * (-2 * size % 4)
    coordinates = b"".join(struct.pack(f"<2{COMPONENTS[component]}", *one) + pad for one in stored)
    buffer = np.array(SQUARE, "<f4").tobytes() + coordinates + np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
    (folder / "wall.bin").write_bytes(buffer)
    stride = 2 * size + len(pad)
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "a", "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"name": "wall", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "wall.png"}, {"uri": "wall.webp"}],
        "buffers": [{"uri": "wall.bin", "byteLength": len(buffer)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 4 * stride, "byteStride": stride},
            {"buffer": 0, "byteOffset": 48 + 4 * stride, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": component, "count": 4, "type": "VEC2", "normalized": component != 5126},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    } | keys
    (folder / "wall.gltf").write_text(json.dumps(header))
    return folder / "wall.gltf"


def read_uv(path: Path) -> FloatArray:
    """Return the texture coordinates (4, 2) of the corners of the wall, v down."""
    found = read_mesh_buildings(path)
    (model,) = found.items
    assert len(found.textures) == 1
    corners = model.shell.vertices[model.shell.triangles].reshape(-1, 3)[:, [0, 2]]
    uv = np.asarray(model.shell.uv, np.float64).reshape(-1, 2) * (1, -1) + (0, 1)
    order = [int(np.abs(corners - place[:2]).sum(axis=1).argmin()) for place in SQUARE]
    return uv[order]


@pytest.mark.parametrize(
    ("component", "scale"), [(5126, 1.0), (5121, 255.0), (5123, 65535.0), (5120, 127.0), (5122, 32767.0)]
)
def test_normalised_texture_coordinates_are_shares(tmp_path: Path, component: int, scale: float) -> None:
    np.testing.assert_allclose(read_uv(write_wall(tmp_path, component, scale)), UV, atol=1 / 127)


@pytest.mark.parametrize(
    ("transform", "right"),
    [
        ({"offset": [0.5, 0.0], "scale": [0.5, 0.5]}, [(0.5, 0.5), (0.75, 0.5), (0.75, 0.25), (0.5, 0.25)]),
        ({"rotation": math.pi / 2}, [(1.0, 0.0), (1.0, -0.5), (0.5, -0.5), (0.5, 0.0)]),
        ({}, UV),
    ],
)
def test_texture_transform_is_applied(tmp_path: Path, transform: dict[str, Any], right: list[Any]) -> None:
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    materials = [{"name": "wall", "pbrMetallicRoughness": {"baseColorTexture": texture}}]
    path = write_wall(tmp_path, materials=materials, extensionsRequired=["KHR_texture_transform"])
    np.testing.assert_allclose(read_uv(path), right, atol=1e-6)


@pytest.mark.parametrize(
    "texture",
    [
        {"index": 0, "texCoord": 1},
        {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}},
    ],
)
def test_the_named_set_of_texture_coordinates_is_read(tmp_path: Path, texture: dict[str, Any]) -> None:
    materials = [{"name": "wall", "pbrMetallicRoughness": {"baseColorTexture": texture}}]
    path = write_wall(tmp_path, materials=materials)
    found = read_mesh_buildings(path)
    assert found.textures == ()
    assert [remark.reason for remark in found.remarks] == [
        "models whose pictures have no texture coordinates: read without"
    ]
    header = json.loads(path.read_text())
    header["meshes"][0]["primitives"][0]["attributes"] = {"POSITION": 0, "TEXCOORD_0": 0, "TEXCOORD_1": 1}
    path.write_text(json.dumps(header))
    np.testing.assert_allclose(read_uv(path), UV, atol=1e-6)


def test_webp_pictures_are_read(tmp_path: Path) -> None:
    textures = [{"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}]
    path = write_wall(tmp_path, textures=textures, extensionsRequired=["EXT_texture_webp"])
    assert read_mesh_buildings(path).textures == (tmp_path / "wall.webp",)


def test_pictures_of_specular_glossiness_are_read(tmp_path: Path) -> None:
    extension = {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": {"index": 0}}}
    path = write_wall(tmp_path, materials=[{"name": "wall", "extensions": extension}])
    np.testing.assert_allclose(read_uv(path), UV, atol=1e-6)


def test_pictures_of_another_format_are_remarked(tmp_path: Path) -> None:
    textures = [{"extensions": {"KHR_texture_basisu": {"source": 1}}}]
    found = read_mesh_buildings(write_wall(tmp_path, textures=textures))
    assert "of another format or absent" in found.remarks[0].reason


def test_quantised_positions_are_shares(tmp_path: Path) -> None:
    path = write_wall(tmp_path)
    header = json.loads(path.read_text())
    positions = np.zeros((4, 4), "<i2")
    positions[:, :3] = np.array(SQUARE) / 4 * 32767
    (tmp_path / "positions.bin").write_bytes(positions.tobytes())
    header["buffers"].append({"uri": "positions.bin", "byteLength": 32})
    header["bufferViews"].append({"buffer": 1, "byteLength": 32, "byteStride": 8})
    header["accessors"][0] |= {"bufferView": 3, "componentType": 5122, "normalized": True}
    header["nodes"][0]["scale"] = [4, 4, 4]
    path.write_text(json.dumps(header | {"extensionsRequired": ["KHR_mesh_quantization"]}))
    np.testing.assert_allclose(read_mesh_buildings(path).items[0].shell.vertices.max(axis=0), [4, 0, 4], atol=1e-3)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"extensionsRequired": ["KHR_texture_basisu"]}, r"needs KHR_texture_basisu, which is not read"),
        ({"extensionsRequired": ["VENDOR_unknown"]}, r"needs VENDOR_unknown, which is not read"),
        ({"extensionsUsed": ["KHR_meshopt_compression"]}, r"is compressed \(KHR_meshopt_compression\)"),
        ({"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}]}, r"needs EXT_mesh_gpu_instancing"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]}, r"triangle fans"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path: Path, keys: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=rf"wall\.gltf .*{words}"):
        read_mesh_buildings(write_wall(tmp_path, **keys))


def write_coloured_model(folder: Path, factor: list[float], **keys: Any) -> Path:
    """Write the wall in a base colour without a picture."""
    return write_wall(folder, materials=[{"name": "wall", "pbrMetallicRoughness": {"baseColorFactor": factor}}], **keys)


def test_a_base_colour_without_a_picture_is_that_of_the_walls(tmp_path: Path) -> None:
    (model,) = read_mesh_buildings(write_coloured_model(tmp_path, [0.5, 0.05, 0.0, 1.0])).items
    assert model.finish.wall_colour == (188, 63, 0)  # linear light in the file, sRGB here
    assert model.finish.roof_colour is None


def test_white_is_the_default_of_gltf_and_states_nothing(tmp_path: Path) -> None:
    (model,) = read_mesh_buildings(write_coloured_model(tmp_path, [1.0, 1.0, 1.0, 1.0])).items
    assert model.finish.wall_colour is None


def test_a_colour_on_a_picture_and_colours_of_vertices_are_counted(tmp_path: Path) -> None:
    both = {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.5, 0.5, 0.5, 1.0]}
    found = read_mesh_buildings(write_wall(tmp_path, materials=[{"name": "wall", "pbrMetallicRoughness": both}]))
    assert [(one.id, one.reason.partition(" (")[0]) for one in found.remarks] == [
        ("a", "models whose pictures are to be multiplied by a colour")
    ]
    assert found.items[0].finish.wall_colour is None
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 0}, "indices": 2}
    found = read_mesh_buildings(write_wall(tmp_path, meshes=[{"primitives": [primitive]}]))
    assert [(one.id, one.reason.partition(" (")[0]) for one in found.remarks] == [
        ("a", "models with a colour at each vertex")
    ]


def test_a_picture_that_is_a_pipe_is_called_one(tmp_path: Path) -> None:
    path = write_wall(tmp_path)
    (tmp_path / "wall.png").unlink()
    os.mkfifo(tmp_path / "wall.png")
    found = read_mesh_buildings(path)
    assert [(one.id, one.reason) for one in found.remarks] == [("wall.png", NO_FILE_REASON)]


def test_pictures_that_end_at_their_borders_are_noted(tmp_path: Path) -> None:
    beyond = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [3, 3]}}}
    materials = [{"name": "wall", "pbrMetallicRoughness": {"baseColorTexture": beyond}}]
    keys = {"materials": materials, "textures": [{"source": 0, "sampler": 0}]}
    path = write_wall(tmp_path, samplers=[{"wrapS": 33071}], **keys)
    assert any("(sampler): repeated there" in remark.reason for remark in read_mesh_buildings(path).remarks)
    path = write_wall(tmp_path, samplers=[{"wrapS": 10497}], **keys)
    assert read_mesh_buildings(path).remarks == ()


def test_a_picture_of_light_alone_is_the_picture(tmp_path: Path) -> None:
    path = write_wall(tmp_path, materials=[{"name": "wall", "emissiveTexture": {"index": 0}}])
    assert [picture.name for picture in read_mesh_buildings(path).textures] == ["wall.png"]


@pytest.mark.parametrize(
    ("extras", "crs"),
    [({"epsg": 32635}, "EPSG:32635"), ({"CRS": "urn:ogc:def:crs:EPSG::3067"}, "EPSG:3067"), ({"crs": "local"}, None)],
)
def test_extras_state_the_frame(tmp_path: Path, extras: dict[str, Any], crs: str | None) -> None:
    path = write_wall(tmp_path, scenes=[{"nodes": [0], "extras": extras}])
    assert read_mesh_buildings(path).crs == crs


def test_other_scenes_and_sideways_models_are_noted(tmp_path: Path) -> None:
    path = write_wall(tmp_path, scenes=[{"nodes": [0]}, {"nodes": []}])
    assert [remark.reason for remark in read_mesh_buildings(path).remarks] == [OTHER_SCENES_REASON]
    shell = read_mesh_buildings(write_wall(tmp_path)).items[0].shell
    surface = MeshSurface("a", "wall", (shell.vertices @ Z_UP_FROM_Y_UP.T)[shell.triangles])
    assert [remark.reason for remark in note_sideways_gltf([surface], "a")] == [Z_UP_GLTF_REASON]


def test_tiles_placed_from_the_centre_of_the_earth_are_refused(tmp_path: Path) -> None:
    path = write_wall(tmp_path, extensionsUsed=["CESIUM_RTC"], extensions={"CESIUM_RTC": {"center": [3e6, 1e6, 5e6]}})
    with pytest.raises(InputError, match="centre of the Earth"):
        read_mesh_buildings(path)
