"""Colours of PLY and STL files."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from catalogs.features import BuildingModels
from catalogs.readers.meshes.models import read_mesh_buildings
from catalogs.readers.meshes.obj import VERTEX_COLOUR_REASON
from catalogs.readers.meshes.plain import PICTURE_REASON, STL_COLOURS_REASON, UNREAD_COLOURS_REASON
from catalogs.readers.source_keys import SourceKeys

RED, GREY = (180, 60, 50), (90, 90, 95)
Z_UP = SourceKeys(up="z")


def box(x: float = 0.0) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((10, 8, 6))
    mesh.apply_translation([x, 0, 3])
    return mesh


def paint_faces(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a house with red walls and a grey roof, its corners apart."""
    colours = np.where(np.abs(mesh.face_normals[:, 2:]) > 0.5, GREY, RED)
    mesh.unmerge_vertices()
    mesh.visual.vertex_colors = np.repeat(np.column_stack([colours, np.full(len(colours), 255)]), 3, axis=0).astype(
        np.uint8
    )
    return mesh


def read_reasons(found: BuildingModels) -> dict[str, list[str]]:
    reasons: dict[str, list[str]] = {}
    for remark in found.remarks:
        reasons.setdefault(remark.reason, []).append(remark.id)
    return reasons


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_colours_of_vertices_are_those_of_walls_and_roof(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "row.ply"
    trimesh.util.concatenate([paint_faces(box()), paint_faces(box(30))]).export(path, encoding=encoding)
    found = read_mesh_buildings(path, keys=Z_UP)
    assert [(one.finish.wall_colour, one.finish.roof_colour) for one in found.items] == [(RED, GREY)] * 2
    assert found.remarks == ()


def test_colours_of_faces(tmp_path: Path) -> None:
    mesh = box()
    mesh.visual.face_colors = np.array([(*RED, 255)] * 12, np.uint8)
    mesh.export(tmp_path / "a.ply")
    (model,) = read_mesh_buildings(tmp_path / "a.ply", keys=Z_UP).items
    assert (model.finish.wall_colour, model.finish.roof_colour) == (RED, RED)


def test_white_is_no_colour(tmp_path: Path) -> None:
    mesh = box()
    mesh.visual.vertex_colors = np.full((8, 4), 255, np.uint8)
    mesh.export(tmp_path / "a.ply")
    found = read_mesh_buildings(tmp_path / "a.ply", keys=Z_UP)
    assert found.items[0].finish.wall_colour is None
    assert found.remarks == ()


def test_colours_of_a_photograph_are_counted_in_steps(tmp_path: Path) -> None:
    mesh = box().subdivide().subdivide()
    mesh.unmerge_vertices()
    noise = np.random.default_rng(1).integers(-8, 9, (len(mesh.vertices), 3))
    mesh.visual.vertex_colors = np.column_stack([np.array([176, 80, 48]) + noise, np.full(len(noise), 255)]).astype(
        np.uint8
    )
    mesh.export(tmp_path / "a.ply")
    found = read_mesh_buildings(tmp_path / "a.ply", keys=Z_UP)
    np.testing.assert_allclose(found.items[0].finish.wall_colour, (176, 80, 48), atol=6)
    assert len(found.items) == 1


def test_pictures_and_other_colours_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    box().export(path, encoding="ascii")
    head, _, rows = path.read_text().partition("end_header\n")
    corners, faces = rows.splitlines()[:8], rows.splitlines()[8:]

    def write(properties: str, values: str) -> None:
        columns = head.replace("property float z\n", f"property float z\n{properties}")
        path.write_text(
            columns + "end_header\n" + "\n".join([*(f"{one.strip()} {values}" for one in corners), *faces]) + "\n"
        )

    write("property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n", "200 10 10")
    assert read_reasons(read_mesh_buildings(path, keys=Z_UP)) == {UNREAD_COLOURS_REASON: ["a.ply"]}
    write("property float s\nproperty float t\n", "0.5 0.5")
    assert read_reasons(read_mesh_buildings(path, keys=Z_UP)) == {PICTURE_REASON: ["a.ply"]}


def test_colours_of_stl_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    box().export(path)
    assert read_reasons(read_mesh_buildings(path, keys=Z_UP)) == {}
    content = bytearray(path.read_bytes())
    struct.pack_into("<H", content, 84 + 48, 0x8000 | 31 << 10)
    path.write_bytes(content)
    assert read_reasons(read_mesh_buildings(path, keys=Z_UP)) == {STL_COLOURS_REASON: ["a.stl"]}


def test_colours_of_obj_vertices_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    box().export(path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(f"{line} 0.7 0.2 0.2" if line.startswith("v ") else line for line in lines))
    assert read_reasons(read_mesh_buildings(path, keys=Z_UP)) == {VERTEX_COLOUR_REASON: ["a.obj"]}
