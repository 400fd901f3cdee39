"""Models of mesh files that are no buildings, are of another unit, or are named by their surfaces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from catalogs.readers.meshes.models import read_mesh_buildings
from catalogs.readers.meshes.plausible_models import FLAT_REASON, OTHER_OBJECT_REASON
from catalogs.readers.meshes.surface_names import merge_surface_names
from catalogs.readers.meshes.surfaces import MeshSurface
from catalogs.readers.source_keys import SourceKeys
from facade_core.core.errors import InputError
from tests.catalogs.readers.meshes.test_up_axis import gabled_house

PLANE = "o Plane\nv -50 -50 0\nv 90 -50 0\nv 90 90 0\nv -50 90 0\nf -4 -3 -2 -1\n"


def read(path: Path, text: str, **keys: str) -> tuple[list[str], list[tuple[str, str]]]:
    path.write_text(text)
    found = read_mesh_buildings(path, keys=SourceKeys(**keys))
    return [model.id for model in found.items], [(one.id, one.reason) for one in found.remarks]


def test_ground_and_terrain_are_set_aside(tmp_path: Path) -> None:
    hill = PLANE.replace("Plane", "Terrain.001").replace("90 90 0", "90 90 8")
    ids, remarks = read(tmp_path / "b.obj", gabled_house(y_up=False) + PLANE + hill, up="z")
    assert ids == ["Cube"]
    assert remarks == [("Plane", FLAT_REASON), ("Terrain.001", OTHER_OBJECT_REASON)]
    with pytest.raises(InputError, match="flat models or terrain only"):
        read(tmp_path / "c.obj", PLANE)


@pytest.mark.parametrize("factor", [100, 1000, 0.01])
def test_models_of_another_unit_are_refused(tmp_path: Path, factor: float) -> None:
    lines = gabled_house(y_up=False).splitlines()
    scaled = [
        "v " + " ".join(str(factor * float(word)) for word in line.split()[1:]) if line.startswith("v ") else line
        for line in lines
    ]
    with pytest.raises(InputError, match="as in another unit; export it in metres"):
        read(tmp_path / "b.obj", "\n".join(scaled))
    if factor < 1:  # degrees
        assert read(tmp_path / "b.obj", "\n".join(scaled), crs="EPSG:4326")[0] == ["Cube"]


def test_earth_centred_models_are_refused(tmp_path: Path) -> None:
    placed = [
        f"v {float(x) + 2_884_000} {float(y) + 1_340_000} {float(z) + 5_510_000}"
        for x, y, z in (line.split()[1:] for line in gabled_house(y_up=False).splitlines() if line.startswith("v "))
    ]
    with pytest.raises(InputError, match="centre of the Earth"):
        read(tmp_path / "b.obj", "\n".join([*placed, "f 1 2 6 5", "f 4 3 2 1"]))


def test_surfaces_of_one_beginning_are_one_building() -> None:
    names = ["House 1 Walls", "House 1 Roof", "B_Wall", "B_Roof", "B_Wall.001", "B_Roof.001", "Old Wall", None, "Roof"]
    surfaces = [MeshSurface(name, "unknown", np.zeros((1, 3, 3))) for name in names]
    merged = merge_surface_names(surfaces)
    assert [one.building for one in merged] == [
        "House 1",
        "House 1",
        "B",
        "B",
        "B.001",
        "B.001",
        "Old Wall",
        None,
        "Roof",
    ]
    assert [one.semantic for one in merged[:2]] == ["wall", "roof"]


def test_ends_of_a_path_in_any_case_are_found(tmp_path: Path) -> None:
    (tmp_path / "textures").mkdir()
    (tmp_path / "textures" / "wall.jpg").write_bytes(b"picture")
    (tmp_path / "b.mtl").write_text(
        "newmtl a\nmap_Ka C:\\Users\\me\\Textures\\WALL.JPG\n".replace("Textures", "textures")
    )
    text = "mtllib B.MTL\nusemtl a\nv 0 0 0\nv 4 0 0\nv 4 0 4\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"
    (tmp_path / "b.obj").write_text(text)
    found = read_mesh_buildings(tmp_path / "b.obj")
    assert [path.name for path in found.textures] == ["wall.jpg"]
