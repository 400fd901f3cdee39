"""Names, ids and paths that differ by their form of Unicode, or by the slashes of their system, are one."""

from __future__ import annotations

import json
import unicodedata
from pathlib import Path

import pytest
from PIL import Image
from shapely import box, to_geojson

from catalogs.block.corrections import read_corrections
from catalogs.block.declared_keys import PathKind
from catalogs.block.paths import resolve_path
from catalogs.features import BuildingModels
from catalogs.readers.formats import read_buildings, read_centrelines
from catalogs.readers.pictures.panoramas import read_panoramas
from catalogs.readers.referenced_files import find_referenced_file
from tests.catalogs.readers.pictures.test_panoramas import LAT, LON, UTM, picture

NAME = "Hämeentie"
DECOMPOSED = unicodedata.normalize("NFD", NAME)


def write_geojson(path: Path, geometry: str, properties: dict[str, object]) -> Path:
    feature = {"type": "Feature", "geometry": json.loads(geometry), "properties": properties}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}, ensure_ascii=False))
    return path


def test_ids_and_names_of_files_are_composed(tmp_path: Path) -> None:
    outline = to_geojson(box(24.9, 60.1, 24.9001, 60.1001))
    path = write_geojson(tmp_path / "b.geojson", outline, {"id": DECOMPOSED, "name": DECOMPOSED, "height": 9})
    [building] = read_buildings(path).items
    assert (building.id, building.name) == (NAME, NAME)
    line = json.dumps({"type": "LineString", "coordinates": [[24.9, 60.1], [24.91, 60.1]]})
    path = write_geojson(tmp_path / "s.geojson", line, {"id": "s", "name": DECOMPOSED})
    assert [street.name for street in read_centrelines(path).items] == [NAME]


def test_corrections_are_composed(tmp_path: Path) -> None:
    block = tmp_path / "a.yaml"
    line = json.dumps({"id": DECOMPOSED, "what": "height", "value": 9}, ensure_ascii=False)
    (tmp_path / "a.corrections.jsonl").write_text(line + "\n")
    assert set(read_corrections(block).by_target) == {NAME}


@pytest.mark.parametrize(("stored", "written"), [(NAME, DECOMPOSED), (DECOMPOSED, NAME)])
def test_paths_are_found_in_either_form(tmp_path: Path, stored: str, written: str) -> None:
    folder = tmp_path / stored
    folder.mkdir()
    file = folder / f"{stored}.png"
    file.touch()
    block, name = tmp_path / "a.yaml", f"{written}/{written}.png"
    assert resolve_path("buildings.path", name, block, PathKind.FILE) == file
    assert resolve_path("buildings.path", name.replace("/", "\\"), block, PathKind.FILE) == file
    assert find_referenced_file(tmp_path / "a.obj", name.replace("/", "\\")) == file


def test_name_with_a_backslash_counts_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "a\\b.gpkg").touch()
    (tmp_path / "a").mkdir()
    (tmp_path / "a/b.gpkg").touch()
    assert resolve_path("buildings.path", "a\\b.gpkg", tmp_path / "a.yaml", PathKind.FILE).name == "a\\b.gpkg"


def test_poses_belong_to_pictures_of_the_other_form(tmp_path: Path) -> None:
    folder = tmp_path / "panoramas"
    folder.mkdir()
    picture(folder / f"{DECOMPOSED}.jpg")
    (tmp_path / "poses.csv").write_text(f"file,lon,lat,heading\n{NAME}.jpg,{LON},{LAT},10\n")
    assert [one.id for one in read_panoramas(folder, tmp_path / "poses.csv", UTM).items] == [NAME]


def test_materials_of_the_other_form_have_their_picture(tmp_path: Path) -> None:
    Image.new("RGB", (8, 8), (9, 99, 200)).save(tmp_path / f"{NAME}.png")
    (tmp_path / "a.mtl").write_text(f"newmtl {DECOMPOSED}\nmap_Kd {DECOMPOSED}.png\n")
    corners = ["0 0 0", "9 0 0", "9 9 0", "0 9 0", "0 0 9", "9 0 9", "9 9 9", "0 9 9"]
    faces = ["1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8", "5 6 7 8"]
    lines = [
        "mtllib a.mtl",
        f"o {DECOMPOSED}",
        f"usemtl {NAME}",
        *(f"v {one}" for one in corners),
        "vt 0 0",
        "vt 1 0",
        "vt 1 1",
    ]
    lines += [f"f {' '.join(f'{corner}/{1 + n % 3}' for n, corner in enumerate(face.split()))}" for face in faces]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    found = read_buildings(tmp_path / "a.obj")
    assert isinstance(found, BuildingModels)
    assert [one.id for one in found.items] == [NAME]
    assert [path.name for path in found.textures] == [f"{NAME}.png"]
