"""Upward axis and texture options of mesh files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from catalogs.block.reader import read_block
from catalogs.readers.meshes.header_comments import read_header_comments
from catalogs.readers.meshes.material_options import TexturePlacement, parse_texture_statement
from catalogs.readers.meshes.models import read_mesh_buildings
from catalogs.readers.meshes.up_axis import UNKNOWN_UP_REASON, Y_UP_REASON, Y_UP_STATED_REASON
from catalogs.readers.source_keys import SourceKeys
from facade_core.core.errors import BlockFileError

# Corners of a box of 14 x 9 x 12 m, z up, and its faces by name.
CORNERS = np.array([(x, y, z) for z in (0, 12) for x, y in ((0, 0), (14, 0), (14, 9), (0, 9))], float)
FACES = {
    "ground": [(4, 3, 2, 1)],
    "roof": [(5, 6, 7, 8)],
    "wall": [(1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8)],
}
TURN = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])


def write_boxes(
    path: Path, *, y_up: bool, named: bool = False, floor: bool = True, turned: bool = False, count: int = 1
) -> Path:
    lines = []
    for number in range(count):
        corners = CORNERS + np.array((0, 40 * number, 0))
        corners = corners @ TURN.T if turned else corners
        corners = corners[:, [0, 2, 1]] * (1, 1, -1) if y_up else corners
        lines += [f"o house{number}", *(f"v {x} {y} {z}" for x, y, z in corners)]
        for name, faces in FACES.items():
            if name != "ground" or floor:
                lines += [f"usemtl {name}"] if named else []
                lines += ["f " + " ".join(str(8 * number + corner) for corner in face) for face in faces]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("y_up", [True, False])
@pytest.mark.parametrize("keys", [{"named": True}, {"named": True, "floor": False}, {"named": True, "turned": True}])
def test_the_upward_axis_is_found_by_names(tmp_path: Path, y_up: bool, keys: dict[str, bool]) -> None:
    found = read_mesh_buildings(write_boxes(tmp_path / "b.obj", y_up=y_up, **keys))  # type: ignore[arg-type]
    for model in found.items:
        assert model.shell.vertices[:, 2].min() == pytest.approx(0)
        assert model.shell.vertices[:, 2].max() == pytest.approx(12)
        corners = model.shell.vertices[model.shell.triangles]
        assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0, (
            "seen from outside"
        )
    assert [remark.reason for remark in found.remarks] == [Y_UP_REASON] * y_up


def test_the_stated_axis_counts(tmp_path: Path) -> None:
    path = write_boxes(tmp_path / "b.obj", y_up=True)
    flat = read_mesh_buildings(path, keys=SourceKeys(up="z"))
    assert (flat.items[0].shell.vertices[:, 2].max(), flat.remarks) == (0, ())
    turned = read_mesh_buildings(path, keys=SourceKeys(up="y"))
    assert turned.items[0].shell.vertices[:, 2].max() == 12
    assert turned.remarks == ()
    named = write_boxes(tmp_path / "c.obj", y_up=True, named=True)
    assert read_mesh_buildings(named, keys=SourceKeys(up="z")).items[0].shell.vertices[:, 2].max() == 0


def gabled_house(*, y_up: bool, name: str = "Cube", east: float = 0, north: float = 6, base: float = 0) -> str:
    """A closed house of 12 x 9 m, 6 m to the eaves and 9 m to the ridge."""
    plan = [(0, 0), (12, 0), (12, 9), (0, 9)]
    corners = [(x, y, z) for z in (0, 6) for x, y in plan] + [(0, 4.5, 9), (12, 4.5, 9)]
    placed = np.array(corners) + np.array((east, north, base))
    placed = placed[:, [0, 2, 1]] * (1, 1, -1) if y_up else placed
    faces = ["4 3 2 1", "1 2 6 5", "3 4 8 7", "2 3 7 10 6", "4 1 5 9 8", "5 6 10 9", "7 8 9 10"]
    relative = [" ".join(str(int(corner) - 11) for corner in face.split()) for face in faces]
    return "\n".join([f"o {name}", *(f"v {x} {y} {z}" for x, y, z in placed), *(f"f {face}" for face in relative), ""])


@pytest.mark.parametrize("y_up", [True, False])
@pytest.mark.parametrize("base", [0, 20])
def test_roofs_without_names_show_the_axis(tmp_path: Path, y_up: bool, base: float) -> None:
    (tmp_path / "b.obj").write_text(gabled_house(y_up=y_up, base=base))
    found = read_mesh_buildings(tmp_path / "b.obj")
    z = found.items[0].shell.vertices[:, 2]
    assert (z.min(), z.max()) == (base, base + 9)
    assert [remark.reason for remark in found.remarks] == [Y_UP_REASON] * y_up


@pytest.mark.parametrize("keys", [{}, {"floor": False}, {"turned": True}, {"count": 3}])
def test_boxes_without_names_do_not_show_the_axis(tmp_path: Path, keys: dict[str, bool]) -> None:
    found = read_mesh_buildings(write_boxes(tmp_path / "b.obj", y_up=False, **keys))  # type: ignore[arg-type]
    assert [remark.reason for remark in found.remarks] == [UNKNOWN_UP_REASON]
    assert {float(np.ptp(model.shell.vertices[:, 2])) for model in found.items} == {12}


@pytest.mark.parametrize(
    ("comment", "up", "unit"),
    [
        ("# Up axis: Y", "y", None),
        ("# axis_up = Z", "z", None),
        ("# exported y-up", "y", None),
        ("# File units = inches", None, 0.0254),
        ("# units: centimeters", None, 0.01),
        ("# Blender 4.1.0", None, None),
        ("comment z is up", "z", None),
    ],
)
def test_comments_state_axis_and_unit(tmp_path: Path, comment: str, up: str | None, unit: float | None) -> None:
    (tmp_path / "b.obj").write_text(f"{comment}\nv 0 0 0\n")
    assert read_header_comments(tmp_path / "b.obj") == (up, unit)


def test_stated_axis_and_unit_place_a_model(tmp_path: Path) -> None:
    lines = gabled_house(y_up=False, base=20)
    (tmp_path / "b.obj").write_text(f"# File units = feet\n{lines}")
    found = read_mesh_buildings(tmp_path / "b.obj")
    assert np.ptp(found.items[0].shell.vertices[:, 2]) == pytest.approx(9 * 0.3048)
    assert ["converted" in remark.reason for remark in found.remarks] == [True]
    in_feet = read_mesh_buildings(tmp_path / "b.obj", keys=SourceKeys(crs="EPSG:2263"))
    assert np.ptp(in_feet.items[0].shell.vertices[:, 2]) == pytest.approx(9)
    (tmp_path / "c.obj").write_text(f"# up: y\n{lines}")
    turned = read_mesh_buildings(tmp_path / "c.obj")
    assert [remark.reason for remark in turned.remarks] == [Y_UP_STATED_REASON]


def test_a_street_of_facades_is_not_turned(tmp_path: Path) -> None:
    walls = "\n".join(f"v {x} 0 {z}" for x, z in ((14, 0), (0, 0), (0, 9), (14, 9)))
    (tmp_path / "b.obj").write_text(f"{walls}\nf 1 2 3 4\n")
    found = read_mesh_buildings(tmp_path / "b.obj")
    assert np.ptp(found.items[0].shell.vertices[:, 2]) == 9
    assert [remark.reason for remark in found.remarks] == [UNKNOWN_UP_REASON]


def test_ply_is_turned(tmp_path: Path) -> None:
    mesh = trimesh.load(write_boxes(tmp_path / "b.obj", y_up=True, floor=False), force="mesh", process=False)
    mesh.export(tmp_path / "b.ply")
    found = read_mesh_buildings(tmp_path / "b.ply", keys=SourceKeys(up="y"))
    assert found.items[0].shell.vertices[:, 2].max() == pytest.approx(12)


def block(folder: Path, path: str, up: str) -> Path:
    keys = {"path": path, "crs": "EPSG:32635", "offset": [385000, 6671000, 0], "up": up}
    text = {"name": "b", "crs": "EPSG:32635", "buildings": keys, "texture": {"walls": "translate"}}
    (folder / "block.yaml").write_text(json.dumps(text))
    return folder / "block.yaml"


def test_the_key_up_of_a_block_file(tmp_path: Path) -> None:
    write_boxes(tmp_path / "b.obj", y_up=True)
    (building,) = read_block(block(tmp_path, "b.obj", "y")).buildings
    assert (building.height, building.base, building.footprint.area) == (12, 0, 126)
    with pytest.raises(BlockFileError, match=r"buildings\.up: 'x' is not `y` or `z`"):
        read_block(block(tmp_path, "b.obj", "x"))
    (tmp_path / "b.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    with pytest.raises(BlockFileError, match=r"buildings\.up.*b\.geojson is not; remove it"):
        read_block(block(tmp_path, "b.geojson", "y"))


@pytest.mark.parametrize(
    ("text", "name", "scale", "offset"),
    [
        ("wall.png", "wall.png", (1, 1), (0, 0)),
        ("-s 2 3 1 -o .5 0 0 wall.png", "wall.png", (2, 3), (0.5, 0)),
        ("-blendu on -s 2 my wall.png", "my wall.png", (2, 1), (0, 0)),
        ("-o 0.25 -clamp on -mm 0 1 a/wall.png", "a/wall.png", (1, 1), (0.25, 0)),
        ("my wall.png", "my wall.png", (1, 1), (0, 0)),
        ("-s 2 2 2 1.png", "1.png", (2, 2), (0, 0)),
    ],
)
def test_options_of_texture_statements(
    text: str, name: str, scale: tuple[float, float], offset: tuple[float, float]
) -> None:
    assert parse_texture_statement(text) == (name, TexturePlacement(scale, offset))


def test_scale_and_offset_place_the_picture(tmp_path: Path) -> None:
    Image.new("RGB", (32, 32)).save(tmp_path / "wall.png")
    (tmp_path / "b.mtl").write_text("newmtl w\nmap_Kd -s 2 2 1 -o 0.5 0 wall.png\n")
    text = "mtllib b.mtl\nusemtl w\nv 0 0 0\nv 4 0 0\nv 4 0 4\nv 0 0 4\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    for faces in ("f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n", "f 1/1 2/2 3/3 4/4\n"):
        (tmp_path / "b.obj").write_text(text + faces)
        (model,) = read_mesh_buildings(tmp_path / "b.obj").items
        corners = model.shell.vertices[model.shell.triangles][..., [0, 2]] / 4
        np.testing.assert_allclose(model.shell.uv, corners * 2 + (0.5, 0), atol=1e-6)
