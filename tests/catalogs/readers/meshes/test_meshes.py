"""Mesh files written small, and the real city models."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from catalogs.features import BuildingModel, BuildingModels
from catalogs.readers.material_colours import SEVERAL_COLOURS_REASON
from catalogs.readers.meshes.models import read_mesh_buildings
from catalogs.readers.referenced_files import NO_FILE_REASON
from catalogs.readers.source_keys import SourceKeys
from facade_core.core.errors import InputError
from facade_core.core.types import SEMANTICS


def box(x: float = 0.0, y: float = 0.0, size: tuple[float, float, float] = (10, 8, 6)) -> trimesh.Trimesh:
    """A block standing on z = 0, seen from outside, z up."""
    mesh = trimesh.creation.box(size)
    mesh.apply_translation([x + size[0] / 2, y + size[1] / 2, size[2] / 2])
    return mesh


def volume(model: BuildingModel) -> float:
    corners = model.shell.vertices[model.shell.triangles] - model.shell.vertices[0]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)


def kinds(model: BuildingModel) -> set[str]:
    return {SEMANTICS[index] for index in model.shell.semantic}


def obj(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def house(x: float) -> str:
    """A gabled house of 10 x 8 x 6 + 4 m: quads, two pentagons, indices counted back from the end."""
    points = [
        (0, 0, 0),
        (10, 0, 0),
        (10, 8, 0),
        (0, 8, 0),
        (0, 0, 6),
        (10, 0, 6),
        (10, 8, 6),
        (0, 8, 6),
        (0, 4, 10),
        (10, 4, 10),
    ]
    walls = [(1, 2, 6, 5), (3, 4, 8, 7), (2, 3, 7, 10, 6), (4, 1, 5, 9, 8)]
    roof, ground = [(5, 6, 10, 9), (7, 8, 9, 10)], [(4, 3, 2, 1)]
    text = "".join(f"v {x + a} {b} {c}\n" for a, b, c in points)
    for name, faces in (("WallSurface", walls), ("RoofSurface", roof), ("GroundSurface", ground)):
        text += f"usemtl {name}\n" + "".join(f"f {' '.join(str(i - 11) for i in face)}\n" for face in faces)
    return text


HOUSE = 10 * 8 * 6 + 10 * 8 * 4 / 2


@pytest.mark.parametrize("key", ["g", "o"])
def test_obj_names_are_buildings_and_materials_kinds(tmp_path: Path, key: str) -> None:
    found = read_mesh_buildings(
        obj(tmp_path / "city.obj", f"{key} House 1\n{house(0)}{key} House 2\n{house(30)}{key} none\n")
    )
    assert found.crs is None
    assert [model.id for model in found.items] == ["House 1", "House 2"]
    for model in found.items:
        assert volume(model) == pytest.approx(HOUSE), "closed, and seen from outside"
        assert kinds(model) == {"wall", "roof", "ground"}
        assert len(model.shell.vertices) == 10
    assert [(fault.id, fault.kind) for fault in found.faults] == [("none", "building")]


def test_obj_groups_of_surfaces_are_one_building_each(tmp_path: Path) -> None:
    text = "".join(f"v {x} {y} {z}\n" for z in (0, 5) for x, y in ((0, 0), (5, 0), (5, 5), (0, 5)))
    text += (
        "g 7|WallSurface\nf 1 2 6 5\ng 7|RoofSurface\nf 5 6 7 8\ng 7|ClosureSurface\nf 2 3 7 6\ng 9|Window\nf 3 4 8 7\n"
    )
    found = read_mesh_buildings(obj(tmp_path / "city.obj", text))
    assert [(model.id, kinds(model), len(model.shell.triangles)) for model in found.items] == [
        ("7", {"wall", "roof"}, 4),
        ("9", {"window"}, 2),
    ]


def test_obj_objects_with_groups_of_kinds(tmp_path: Path) -> None:
    text = "".join(f"v {x} 0 {z}\n" for x in (0, 5, 20, 25) for z in (0, 5))
    text += "o A\ng walls\nf 1 3 4\ng Door.001\nf 1 4 2\no B\ng walls\nf 5 7 8\n"
    found = read_mesh_buildings(obj(tmp_path / "city.obj", text))
    assert [(model.id, kinds(model)) for model in found.items] == [("A", {"wall", "door"}), ("B", {"wall"})]


def test_obj_concave_polygons_are_cut_inside(tmp_path: Path) -> None:
    ring = [(0, 0), (9, 0), (9, 9), (6, 9), (6, 3), (3, 3), (3, 9), (0, 9)]
    text = "".join(f"v {x} 0 {z}\n" for x, z in ring) + "f " + " \\\n".join(str(i + 1) for i in range(8)) + "\n"
    (model,) = read_mesh_buildings(obj(tmp_path / "u.obj", text)).items
    assert model.id == "u"
    corners = model.shell.vertices[model.shell.triangles]
    areas = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] / 2
    assert areas.sum() == pytest.approx(81 - 18)
    assert (areas > 0).all()


def test_obj_without_names_falls_into_its_parts(tmp_path: Path) -> None:
    text = house(50) + house(0) + "v 52 1 9\nv 53 1 9\nv 53 2 12\nf -3 -2 -1\n"
    found = read_mesh_buildings(obj(tmp_path / "block.obj", text))
    assert [model.id for model in found.items] == ["block-0", "block-1"], "from west to east, the dormer with its house"
    assert [model.shell.vertices[:, 0].min() for model in found.items] == [0, 50]
    assert len(found.items[1].shell.triangles) == len(found.items[0].shell.triangles) + 1


def test_a_broken_vertex_costs_one_building(tmp_path: Path) -> None:
    wrong = ["v nan 0 0\n", "v one 0 0\n", "v 1 0\n", "v inf 0 0\n"]
    text = "".join(f"g bad{i}\n{line}v 0 0 0\nv 1 0 0\nf -1 -2 -3\n" for i, line in enumerate(wrong))
    text += "g missing\nv 0 0 0\nv 1 0 0\nf -1 -2 999999\ng good\n" + house(0)
    found = read_mesh_buildings(obj(tmp_path / "city.obj", text))
    assert [model.id for model in found.items] == ["good"]
    assert [fault.id for fault in found.faults] == ["bad0", "bad1", "bad2", "bad3", "missing"]
    assert found.faults[0].place.bounds[2] == 1
    unnamed = read_mesh_buildings(obj(tmp_path / "block.obj", house(50).replace("v 50 0 0", "v 50 0 nan") + house(0)))
    assert [model.id for model in unnamed.items] == ["block-0"]
    assert [fault.id for fault in unnamed.faults] == ["block-1"]


def test_obj_textures_are_files(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    Image.new("RGB", (4, 4)).save(tmp_path / "pictures/wall.png")
    Image.new("RGB", (4, 4)).save(tmp_path / "unused.png")
    lines = [
        "newmtl roof",
        "map_Kd gone.png",
        "newmtl other",
        "map_Kd unused.png",
        "newmtl wall",
        "map_Kd -s 1 1 1 pictures\\wall.png",
    ]
    (tmp_path / "a.mtl").write_text("\n".join(lines))
    text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 0.5\nvt 0 0.5\n"
    text += "usemtl roof\nf 1/1 2/2 3/3\nusemtl wall\nf 1/1/1 2/2/1 3/3/1 4/4/1\n"
    found = read_mesh_buildings(obj(tmp_path / "a.obj", text))
    assert found.textures == (tmp_path / "pictures/wall.png",)
    assert [remark.id for remark in found.remarks] == ["gone.png"]
    shell = found.items[0].shell
    assert shell.texture.tolist() == [-1, 0, 0]
    corners = shell.vertices[shell.triangles]
    np.testing.assert_allclose(shell.uv[1:], (corners[..., [0, 2]] * (1, 0.5))[1:])


def glb(path: Path, meshes: dict[str, trimesh.Trimesh], origin: list[float] | None = None) -> Path:
    """Written y up, as glTF is."""
    scene = trimesh.Scene(metadata={"origin": origin} if origin else {})
    for name, mesh in meshes.items():
        turned = mesh.copy()
        turned.vertices = mesh.vertices[:, [0, 2, 1]] * (1, 1, -1)
        scene.add_geometry(turned, node_name=name, geom_name=f"mesh-{name}")
    scene.export(path)
    return path


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gltf_is_turned_and_moved_to_its_origin(tmp_path: Path, suffix: str) -> None:
    path = glb(tmp_path / f"city{suffix}", {"12": box(), "a": box(20)}, [1000.0, 2000.0, 30.0])
    found = read_mesh_buildings(path)
    assert [model.id for model in found.items] == ["12", "a"]
    np.testing.assert_allclose(found.items[1].shell.vertices.min(axis=0), [1020, 2000, 30], atol=1e-4)
    np.testing.assert_allclose(found.items[1].shell.vertices.max(axis=0), [1030, 2008, 36], atol=1e-4)
    assert volume(found.items[0]) == pytest.approx(480, rel=1e-4)


def edited(path: Path, edit: Any) -> Path:
    """A .gltf with its header changed."""
    header = json.loads(path.read_text())
    edit(header)
    path.write_text(json.dumps(header))
    return path


def test_gltf_parts_of_a_building_hang_under_its_node(tmp_path: Path) -> None:
    def edit(header: dict[str, Any]) -> None:
        nodes = header["nodes"]
        roof, wall, other = (next(i for i, n in enumerate(nodes) if n.get("name") == name) for name in ("r", "w", "o"))
        nodes[roof]["name"], nodes[wall]["name"] = "RoofSurface", "WallSurface"
        nodes.append({"name": "B1", "children": [roof, wall], "translation": [100, 0, 0]})
        nodes.append({"name": "B2", "children": [other], "scale": [1, 2, 1]})
        # two primitives, named by their materials
        header["materials"] = [{"name": "brick wall"}, {"name": "roof tiles"}]
        primitive = header["meshes"][nodes[other]["mesh"]]["primitives"][0]
        nodes[other]["name"] = "Wall"
        header["meshes"][nodes[other]["mesh"]] = {
            "primitives": [primitive | {"material": 1}, primitive | {"material": 0}]
        }
        header["scenes"][0]["nodes"] = [len(nodes) - 2, len(nodes) - 1]

    path = glb(tmp_path / "city.gltf", {"r": box(0, 0, (10, 8, 1)), "w": box(), "o": box(50)})
    found = read_mesh_buildings(edited(path, edit))
    assert [(model.id, kinds(model)) for model in found.items] == [("B1", {"roof", "wall"}), ("B2", {"wall"})]
    assert found.items[0].shell.vertices[:, 0].min() == pytest.approx(100)
    assert found.items[1].shell.vertices[:, 2].max() == pytest.approx(12)
    assert read_mesh_buildings(path).items[1].shell.vertices.tolist() == found.items[1].shell.vertices.tolist()


def textured(path: Path) -> Path:
    picture = Image.new("RGB", (4, 4), (200, 0, 0))
    mesh = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    material = trimesh.visual.material.PBRMaterial(name="m", baseColorTexture=picture)
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    trimesh.Scene({"a": mesh}).export(path)
    return path


def test_gltf_textures_are_kept_as_files_and_dropped_when_embedded(tmp_path: Path) -> None:
    before = sorted(tmp_path.iterdir())
    inside = read_mesh_buildings(textured(tmp_path / "a.glb"))
    assert inside.textures == ()
    assert [remark.id for remark in inside.remarks] == ["a"]
    assert sorted(tmp_path.iterdir()) == [*before, tmp_path / "a.glb"], "nothing is written"
    Image.new("RGB", (4, 4)).save(tmp_path / "red wall.png")
    path = textured(tmp_path / "b.gltf")
    beside = read_mesh_buildings(edited(path, lambda header: header.update(images=[{"uri": "red%20wall.png"}])))
    assert beside.textures == (tmp_path / "red wall.png",)
    shell = beside.items[0].shell
    assert shell.texture.tolist() == [0, 0]
    corners = shell.vertices[shell.triangles]  # y of the file is up
    np.testing.assert_allclose(shell.uv, corners[..., [0, 2]] / 4, atol=1e-6)


def test_compressed_gltf_is_refused(tmp_path: Path) -> None:
    path = glb(tmp_path / "a.gltf", {"a": box()})
    edited(path, lambda header: header.update(extensionsUsed=["KHR_draco_mesh_compression"]))
    with pytest.raises(InputError, match=r"a\.gltf is compressed"):
        read_mesh_buildings(path)


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_one_mesh_falls_into_buildings(tmp_path: Path, suffix: str) -> None:
    chimney = box(13, 3, (1, 1, 9))
    terrace = box(10.0, 0.0)  # touches its neighbour's wall, shares no vertex after the shift
    terrace.apply_translation([0.02, 1.0, 0])
    path = tmp_path / f"row{suffix}"
    trimesh.util.concatenate([chimney, terrace, box()]).export(path)
    found = read_mesh_buildings(path)
    assert [(model.id, len(model.shell.triangles)) for model in found.items] == [("row-0", 12), ("row-1", 24)]
    assert kinds(found.items[0]) == {"unknown"}


def npz(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def test_npz_features_are_buildings(tmp_path: Path) -> None:
    corners = np.concatenate([box().triangles, box(30).triangles, box(60).triangles]).astype(np.float32)
    feature = np.repeat([5, 3, 8], 12)
    corners[-1, 0, 0] = np.nan
    found = read_mesh_buildings(
        npz(tmp_path / "a.npz", triangles=corners, feature=feature, origin=[1e6, 2e6, 5.0], epsg=3946)
    )
    assert found.crs == "EPSG:3946"
    assert [model.id for model in found.items] == ["3", "5"]
    np.testing.assert_allclose(found.items[1].shell.vertices.min(axis=0), [1e6, 2e6, 5])
    assert [fault.id for fault in found.faults] == ["8"]


def test_npz_features_that_are_single_surfaces_are_put_together(tmp_path: Path) -> None:
    corners = np.concatenate([box(30).triangles, box().triangles])
    normals = np.round(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).astype(int)
    feature = np.unique(np.column_stack([np.repeat([0, 1], 12), normals]), axis=0, return_inverse=True)[1].ravel()
    assert len(np.unique(feature)) == 12
    found = read_mesh_buildings(npz(tmp_path / "town.npz", triangles=corners, feature=feature))
    assert [model.id for model in found.items] == ["town-0", "town-1"]
    assert found.crs is None
    assert [volume(model) for model in found.items] == pytest.approx([480, 480])


@pytest.mark.parametrize(
    "arrays",
    [
        {"triangles": np.zeros((2, 3, 3))},
        {"triangles": np.zeros((2, 3, 2)), "feature": np.zeros(2, int)},
        {"triangles": np.zeros((2, 3, 3)), "feature": np.zeros(3, int)},
        {"triangles": np.zeros((2, 3, 3)), "feature": np.zeros(2, int), "origin": np.zeros(2)},
        {"triangles": np.array([{}, {}]), "feature": np.zeros(2, int)},
        {"triangles": np.zeros((0, 3, 3)), "feature": np.zeros(0, int)},
    ],
)
def test_npz_of_other_arrays_is_refused(tmp_path: Path, arrays: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"a\.npz"):
        read_mesh_buildings(npz(tmp_path / "a.npz", **arrays))


@pytest.mark.parametrize("suffix", [".obj", ".glb", ".gltf", ".ply", ".stl", ".npz"])
@pytest.mark.parametrize("content", [b"", b"nothing of the kind", b"glTF\x02\x00\x00\x00 too short"])
def test_broken_files_are_refused_by_name(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"broken\{suffix}"):
        read_mesh_buildings(path)


@pytest.fixture(scope="module")
def ingolstadt(data: Path) -> BuildingModels:
    return read_mesh_buildings(data / "city/ingolstadt/lod2_shell.obj")


def test_ingolstadt(ingolstadt: BuildingModels) -> None:
    assert len(ingolstadt.items) == 53
    assert ingolstadt.faults == ()
    assert all(kinds(model) == {"wall", "roof", "ground"} for model in ingolstadt.items)
    assert sum(volume(model) > 0 for model in ingolstadt.items) > 50, "seen from outside"


def test_amsterdam_has_dutch_groups_of_one_building(data: Path) -> None:
    (model,) = read_mesh_buildings(data / "city/amsterdam/0363100012143961.obj").items
    assert model.id == "0363100012143961"
    assert kinds(model) == {"wall", "roof"}


BOX = """mtllib box.mtl
v 0 0 0
v 9 0 0
v 9 9 0
v 0 9 0
v 0 0 5
v 9 0 5
v 9 9 5
v 0 9 5
g house
usemtl brick
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
usemtl plaster
f 4 1 5 8
usemtl tiles
f 5 6 7 8
f 1 4 3 2
"""


def test_colours_of_materials_without_a_picture_are_those_of_most_of_a_building(tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_text(BOX)
    (tmp_path / "box.mtl").write_text(
        "newmtl brick\nKd 0.6 0.2 0.1\nnewmtl plaster\nKd 0.9 0.9 0.8\nnewmtl tiles\nKd 0.4 0.4 0.4\n"
    )
    found = read_mesh_buildings(tmp_path / "box.obj", keys=SourceKeys(up="z"))
    assert found.items[0].finish.wall_colour == (153, 51, 26)
    assert found.items[0].finish.roof_colour == (102, 102, 102)
    assert [(one.id, one.reason) for one in found.remarks] == [("house", SEVERAL_COLOURS_REASON)]


@pytest.mark.parametrize("kind", ["pipe", "folder"])
def test_a_picture_that_is_no_file_is_called_that(tmp_path: Path, kind: str) -> None:
    (tmp_path / "box.obj").write_text(BOX)
    (tmp_path / "box.mtl").write_text("newmtl brick\nmap_Kd wall.png\n")
    if kind == "pipe":
        os.mkfifo(tmp_path / "wall.png")
    else:
        (tmp_path / "wall.png").mkdir()
    found = read_mesh_buildings(tmp_path / "box.obj", keys=SourceKeys(up="z"))
    assert [(one.id, one.reason) for one in found.remarks] == [("wall.png", NO_FILE_REASON)]


def test_an_obj_with_a_mark_of_byte_order_keeps_its_first_group(tmp_path: Path) -> None:
    corners = "v 0 0 0\nv 9 0 0\nv 0 0 6\nv 20 0 0\nv 29 0 0\nv 20 0 6\n"
    (tmp_path / "a.obj").write_text(f"o first\n{corners}f 1 2 3\no second\nf 4 5 6\n", "utf-8-sig")
    assert [model.id for model in read_mesh_buildings(tmp_path / "a.obj").items] == ["first", "second"]


@pytest.mark.parametrize("name", [None, "Mesh"])
def test_instances_of_a_mesh_are_buildings(tmp_path: Path, name: str | None) -> None:
    path = glb(tmp_path / "m.gltf", {"House": box(), "Shed": box(60)})

    def repeat(header: Any) -> None:
        nodes, meshes = header["nodes"], header["meshes"]
        drawn = next(node for node in nodes if node.get("mesh") == 0)
        meshes[0]["name"] = "House"
        drawn.pop("name", None)
        drawn |= {} if name is None else {"name": name}
        nodes.append({**drawn, "translation": [0.0, 0.0, 30.0]})
        header["scenes"][0]["nodes"].append(len(nodes) - 1)
        header.pop("cameras", None)

    found = read_mesh_buildings(edited(path, repeat))
    expected = name or "House"
    assert sorted(model.id for model in found.items) == sorted([expected, f"{expected}-2", "Shed"])
    assert [remark.id for remark in found.remarks if "numbered" in remark.reason] == [f"{expected}-2"]
    assert [volume(model) for model in found.items] == pytest.approx([480.0] * 3)
