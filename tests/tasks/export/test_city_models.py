"""CityJSON and LoD3 of a whole published run: sound by themselves, by val3dity and by cjio."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import geopandas as gpd
import numpy as np
import pytest

from benchmarks.solid import validated
from catalogs.readers.cityjson.buildings import read_cityjson
from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock

Run = tuple[Path, dict[str, Any]]


def cityjson_is_sound(city: dict[str, Any]) -> None:
    """Indices in range and all used, one texture index per corner, a semantic surface per surface, parents know children."""
    corners, places = set(), set()
    textures = city.get("appearance", {}).get("textures", [])
    for thing in city["CityObjects"].values():
        for geometry in thing["geometry"]:
            solid = geometry["type"] == "Solid"
            boundaries, textures_of = geometry["boundaries"], geometry["texture"]["streetloom"]["values"]
            (boundaries, textures_of) = (boundaries[0], textures_of[0]) if solid else (boundaries, textures_of)
            for surface, texture in zip(boundaries, textures_of, strict=True):
                for ring, shown in zip(surface, texture, strict=True):
                    corners.update(ring)
                    assert len(set(ring)) == len(ring) >= 3
                    if shown != [None]:
                        assert 0 <= shown[0] < len(textures)
                        assert len(shown) == len(ring) + 1
                        places.update(shown[1:])
            if solid:
                watertight(boundaries)
            if geometry["type"] != "CompositeSurface":
                surfaces = geometry["semantics"]["surfaces"]
                values = geometry["semantics"]["values"][0] if solid else geometry["semantics"]["values"]
                assert set(values) <= set(range(len(surfaces)))
                assert len(values) == len(boundaries)
                for i, surface in enumerate(surfaces):
                    assert "parent" not in surface or i in surfaces[surface["parent"]]["children"]
    assert corners == set(range(len(city["vertices"])))
    assert places == set(range(len(city["appearance"]["vertices-texture"])))


def watertight(shell: list[list[list[int]]]) -> None:
    """Each edge is there twice, in opposite directions."""
    edges = Counter(e for rings in shell for ring in rings for e in zip(ring, ring[1:] + ring[:1], strict=True))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def test_cityjson_is_read_again_where_it_was(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    path = export_run(undisturbed[0], "cityjson", tmp_path / "city").files[0]
    city = json.loads(path.read_text())
    cityjson_is_sound(city)
    for name, thing in city["CityObjects"].items():
        if thing["type"] == "Building":
            (geometry,) = thing["geometry"]
            assert geometry["type"] == "Solid", name
            heights = [0.001 * city["vertices"][i][2] for face in geometry["boundaries"][0] for r in face for i in r]
            assert thing["attributes"]["measuredHeight"] == pytest.approx(max(heights) - min(heights), abs=0.002)
            assert thing["attributes"]["measuredHeight"] >= thing["attributes"].get("eavesHeight", 0) - 0.002
    assert city["metadata"]["referenceSystem"].endswith("/EPSG/0/32635")
    again = read_cityjson(path)
    assert {model.id for model in again.items} == {found.names[b] for b in found.select_buildings(()).tolist()}
    assert not again.faults
    assert all(texture.is_file() for texture in again.textures)
    mesh = found.plan.scene.mesh
    mine = mesh.vertices[found.plan.scene.charts.building[mesh.vertex_chart] >= 0]
    points = np.concatenate([model.shell.vertices for model in again.items])
    np.testing.assert_allclose(points.min(axis=0), mine.min(axis=0), atol=0.002)
    np.testing.assert_allclose(points.max(axis=0), mine.max(axis=0), atol=0.002)


def test_lod3_has_the_openings_of_the_catalogue(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    path = export_run(undisturbed[0], "lod3", tmp_path / "lod3").files[0]
    city = json.loads(path.read_text())
    cityjson_is_sound(city)
    windows: dict[str, int] = {}
    for thing in city["CityObjects"].values():
        for geometry in thing["geometry"]:
            surfaces = geometry.get("semantics", {}).get("surfaces", [])
            for surface in surfaces:
                if surface["type"] == "Window":
                    facade = surfaces[surface["parent"]]["facade"]
                    windows[facade] = windows.get(facade, 0) + 1
    items = gpd.read_parquet(found.snapshot.items)
    expected = dict(items[(items.kind == "facade") & (items.windows > 0)].set_index("id").windows)
    assert windows.keys() == expected.keys()
    assert sum(windows.values()) >= 0.97 * sum(expected.values())


@pytest.mark.long
@pytest.mark.parametrize("style", ["cityjson", "lod3"])
def test_val3dity_finds_every_object_valid(data: Path, undisturbed: Run, tmp_path: Path, style: str) -> None:
    validator = data.parent / "tools" / "val3dity" / "run"
    if not validator.is_file():
        pytest.skip(f"{validator} is not there: solids are not validated by it")
    path = export_run(undisturbed[0], style, tmp_path / style).files[0]
    valid, errors = validated(path, validator)
    assert not errors
    assert set(json.loads(path.read_text())["CityObjects"]) == set(valid)
    assert all(valid.values())


@pytest.mark.long
def test_lod3_is_the_same_in_two_exports(undisturbed: Run, tmp_path: Path) -> None:
    one, other = (
        export_run(undisturbed[0], "lod3", tmp_path / name).files[0].read_bytes() for name in ("one", "other")
    )
    assert one == other


def test_a_stream_is_a_header_and_features_that_stand_alone(
    found: PublishedBlock, undisturbed: Run, tmp_path: Path
) -> None:
    path = export_run(undisturbed[0], "cityjsonseq", tmp_path / "seq").files[0]
    header, *features = map(json.loads, path.read_text().splitlines())
    assert header["CityObjects"] == {}
    assert header["vertices"] == []
    kinds = Counter(feature["CityObjects"][feature["id"]]["type"] for feature in features)
    assert kinds["Building"] == len(found.select_buildings(()))
    assert kinds["TINRelief"] >= 1
    for feature in features:
        assert feature["type"] == "CityJSONFeature"
        assert feature["id"] in feature["CityObjects"]
        cityjson_is_sound(feature)
        assert all((path.parent / texture["image"]).is_file() for texture in feature["appearance"]["textures"])
    assert {m.id for m in read_cityjson(path).items} == {found.names[b] for b in found.select_buildings(()).tolist()}


# cjio rounds what every json in its process writes, so it has one of its own
CJIO = """
import json, sys
from cjio import cityjson
path, first, second = sys.argv[1:]
parts = []
for name in (first, second):
    with open(path) as file:
        part = cityjson.reader(file).get_subset_ids([name])
    part.remove_duplicate_vertices()
    parts.append(part)
textures = [part.j["appearance"]["textures"] for part in parts]
parts[0].merge([parts[1]])
print(json.dumps({"textures": textures, "merged": parts[0].j}))
"""


def test_cjio_keeps_the_textures_of_a_subset_and_a_merge(
    found: PublishedBlock, undisturbed: Run, tmp_path: Path
) -> None:
    path = export_run(undisturbed[0], "cityjson", tmp_path / "city").files[0]
    first, second = (found.names[b] for b in found.select_buildings(())[:2].tolist())
    command = [sys.executable, "-c", CJIO, str(path), first, second]
    done = json.loads(subprocess.run(command, capture_output=True, text=True, check=True, timeout=300).stdout)
    for textures in done["textures"]:
        assert textures
        assert all((path.parent / texture["image"]).is_file() for texture in textures)
    merged = done["merged"]
    assert {first, second} <= set(merged["CityObjects"])
    for id in (first, second):
        values = merged["CityObjects"][id]["geometry"][0]["texture"]["streetloom"]["values"]
        textured = [ring for surface in values[0] for ring in surface if ring != [None]]
        assert textured
        assert max(max(ring[1:]) for ring in textured) < len(merged["appearance"]["vertices-texture"])
