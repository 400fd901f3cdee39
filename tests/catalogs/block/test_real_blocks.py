"""Blocks from the files that users have: every vector format alike, broken units by name, the example blocks."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import geopandas as gpd
import numpy as np
import pytest
import yaml
from PIL import Image
from shapely import LineString, Polygon, box, transform

from catalogs.block.reader import Block, read_block
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from catalogs.features import safe_file_stem
from facade_core.core.errors import BlockFileError

# Two houses and a street in Amsterdam, metres of EPSG:28992.
ORIGIN = (121_000.0, 487_000.0)
HOUSES = [box(0, 0, 12, 10), box(20, 0, 32, 10)]
STREET = LineString([(-5, -8), (40, -8)])


def placed(shape):
    return transform(shape, lambda xy: xy + ORIGIN)


def houses(outlines: list = HOUSES, **columns: list) -> gpd.GeoDataFrame:
    return gpd.GeoDataFrame(columns, geometry=[placed(o) for o in outlines], crs="EPSG:28992")


@pytest.fixture
def block(tmp_path: Path) -> Callable[..., Block]:
    """Read a block of files in a folder, with one exemplar."""
    (tmp_path / "facades").mkdir()
    Image.new("RGB", (40, 60)).save(tmp_path / "facades" / "0.png")

    def read(buildings: str | list[str] | dict, **keys: object) -> Block:
        known = {
            "name": "b",
            "buildings": buildings if isinstance(buildings, dict) else {"path": buildings},
            "imagery": {"exemplars": {"path": "facades"}},
        }
        (tmp_path / "block.yaml").write_text(yaml.safe_dump(known | keys))
        return read_block(tmp_path / "block.yaml")

    return read


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".parquet", ".fgb", ".shp"])
def test_footprints_are_the_same_from_every_vector_format(block, tmp_path: Path, suffix: str) -> None:
    frame = houses(height=[9.0, None], levels=[None, 4], name=["inn", None])
    frame = frame.to_crs(4326) if suffix == ".geojson" else frame
    path = tmp_path / f"houses{suffix}"
    frame.to_parquet(path) if suffix == ".parquet" else frame.to_file(path)
    found = block(path.name, crs="EPSG:28992")
    west_first = sorted(found.buildings, key=lambda building: building.footprint.bounds)
    assert [b.height_source for b in west_first] == ["height", "levels"]
    # what is stated is to the ridge; storeys end at the eaves
    roofs = [b.roof for b in west_first if b.roof is not None]
    assert west_first[0].height + roofs[0].height == pytest.approx(9.0)
    assert west_first[1].height == pytest.approx(12.8)
    assert all(0 < roof.confidence < 1 for roof in roofs)
    assert [b.footprint.area for b in found.buildings] == pytest.approx([120, 120], abs=0.01)
    assert found.streets == ()
    assert found.faults == ()


def test_the_frame_is_the_buildings_own_where_it_measures_metres(block, tmp_path: Path) -> None:
    houses().to_file(tmp_path / "metres.gpkg")
    houses().to_crs(4326).to_file(tmp_path / "degrees.gpkg")
    houses().to_crs(3857).to_file(tmp_path / "web.gpkg")
    assert block("metres.gpkg").crs.to_epsg() == 28992
    assert block("degrees.gpkg").crs.to_epsg() == 32631
    assert block("web.gpkg").crs.to_epsg() == 32631
    assert (
        block("metres.gpkg")
        .notes[0]
        .startswith("CRS of the block: EPSG:28992 (Amersfoort / RD New), as the buildings state")
    )
    assert "as the buildings lie at longitude" in block("degrees.gpkg").notes[0]
    assert "as EPSG:3857 does not measure metres there" in block("web.gpkg").notes[0]


def test_models_without_a_frame_take_the_one_that_is_given(block, tmp_path: Path) -> None:
    lines = [f"v {x} {y} {z}" for z in (0, 9) for x, y in ((0, 0), (12, 0), (12, 10), (0, 10))]
    faces = [(1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8), (5, 6, 7, 8), (4, 3, 2, 1)]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    (tmp_path / "house.obj").write_text("\n".join(lines))
    with pytest.raises(BlockFileError, match=r"buildings\.crs: missing, and .*house\.obj states no frame"):
        block("house.obj")
    keys = {"path": "house.obj", "crs": "EPSG:28992", "offset": [*ORIGIN, 2.5]}
    (building,) = block(keys).buildings
    assert building.footprint.equals(placed(HOUSES[0]))
    assert (building.base, building.height) == (2.5, 9.0)


def test_broken_units_are_named_and_the_rest_is_kept(block, tmp_path: Path) -> None:
    bowtie = Polygon([(40, 0), (50, 10), (50, 0), (40, 10)])
    houses([*HOUSES, bowtie], id=["one", "two", "bow"]).to_file(tmp_path / "houses.gpkg", layer="buildings")
    streets = [placed(STREET), placed(LineString([(0, -8), (0, -8)]))]
    gpd.GeoDataFrame({"id": ["long", "point"]}, geometry=streets, crs="EPSG:28992").to_file(tmp_path / "streets.gpkg")
    (tmp_path / "empty.city.json").write_text(
        json.dumps(
            {
                "type": "CityJSON",
                "version": "2.0",
                "transform": {"scale": [1, 1, 1], "translate": [0, 0, 0]},
                "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/28992"},
                "CityObjects": {"nothing": {"type": "Building", "geometry": []}},
                "vertices": [],
            }
        )
    )
    whole = tmp_path / "facades" / "cut.jpg"
    Image.effect_noise((200, 200), 80).save(whole)
    whole.write_bytes(whole.read_bytes()[:2000])
    found = block(["houses.gpkg", "empty.city.json"], streets={"path": "streets.gpkg"})
    assert [building.id for building in found.buildings] == ["one", "two"]
    assert len(found.streets) == 1
    assert len(found.exemplars) == 1
    assert {(fault.kind, fault.id) for fault in found.faults} == {
        ("building", "bow"),
        ("building", "nothing"),
        ("street", "point"),
        ("exemplar", "cut.jpg"),
    }
    assert all(fault.reason and "\n" not in fault.reason for fault in found.faults)


def test_a_block_of_broken_buildings_only_is_refused_with_the_first_reason(block, tmp_path: Path) -> None:
    houses([Polygon([(40, 0), (50, 10), (50, 0), (40, 10)])], id=["bow"]).to_file(tmp_path / "houses.gpkg")
    with pytest.raises(BlockFileError, match=r"no buildings that can be used: bow: its footprint crosses itself"):
        block("houses.gpkg")


@pytest.mark.parametrize(
    ("name", "buildings", "heights", "faults"),
    [
        ("amsterdam-dam", 2, {"height"}, {"panorama"}),
        ("amsterdam-ij", 3, {"height", "model"}, {"panorama"}),
        ("delfshaven", range(60, 101), {"model"}, set()),
        ("ingolstadt", 53, {"model"}, set()),
        ("plateau", 8, {"model"}, set()),
    ],
)
def test_example_blocks(
    name: str, buildings: int | range, heights: set[str], faults: set[str], data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STREETLOOM_DATA", str(data))
    found = read_block(EXAMPLE_BLOCKS_FOLDER / f"{name}.yaml")
    assert len(found.buildings) in (buildings if isinstance(buildings, range) else (buildings,))
    assert set(Counter(building.height_source for building in found.buildings)) == heights
    assert {fault.kind for fault in found.faults} == faults
    assert len(found.textures) == (8 if name == "plateau" else 0)
    assert found.crs.axis_info[0].unit_name == "metre"


def test_streets_that_are_nowhere_near_are_refused(block, tmp_path: Path) -> None:
    houses().to_file(tmp_path / "houses.gpkg")
    far = transform(placed(STREET), lambda xy: xy + np.array([100_000, 0]))
    gpd.GeoDataFrame({"id": ["far"]}, geometry=[far], crs="EPSG:28992").to_file(tmp_path / "far.gpkg")
    with pytest.raises(BlockFileError, match=r"no street comes within 200 m of a building .*; check streets\.crs"):
        block("houses.gpkg", streets={"path": "far.gpkg"})


def test_a_block_far_from_where_its_frame_is_used_is_noted(block, tmp_path: Path) -> None:
    gpd.GeoDataFrame(geometry=HOUSES, crs="EPSG:25832").to_file(tmp_path / "local.gpkg")
    assert any("far from where EPSG:25832" in note for note in block("local.gpkg").notes)
    houses().to_file(tmp_path / "houses.gpkg")
    assert block("houses.gpkg", crs="EPSG:28992").notes[0].startswith("2 of 2 buildings state no height")


def test_a_missing_or_repeated_id_changes_no_other(block, tmp_path: Path) -> None:
    outlines = [box(20.0 * i, 0, 20.0 * i + 12, 10) for i in range(6)]
    houses(outlines, id=["A/1", None, "C", "C", "E", "F"]).to_file(tmp_path / "houses.gpkg")
    assert {building.id for building in block("houses.gpkg").buildings} == {"A/1", "row-1", "C", "C-2", "E", "F"}


def test_ids_become_names_of_files() -> None:
    assert safe_file_stem("{0D6F-3} w12-0") == "{0D6F-3} w12-0"
    odd = [safe_file_stem(text) for text in ("A/B", "A_B/", "../evil", ".hidden", "a\\b", "ü", "x:y")]
    assert len(set(odd)) == len(odd)
    assert all("/" not in name and "\\" not in name and not name.startswith(".") for name in odd)
