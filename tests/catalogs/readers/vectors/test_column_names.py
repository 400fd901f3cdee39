"""Columns in the languages and forms of many maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import geopandas
import pytest
import shapely

from catalogs.readers.formats import read_buildings
from catalogs.readers.vectors.vector_files import read_vector_centrelines, read_vector_footprints
from facade_core.core.errors import InputError


def outline(path: Path, columns: dict[str, Any]) -> Path:
    table = geopandas.GeoDataFrame(
        {name: [value] for name, value in columns.items()}, geometry=[shapely.box(0, 0, 12, 9)], crs="EPSG:32635"
    )
    table.to_file(path)
    return path


@pytest.mark.parametrize(
    ("columns", "height", "levels"),
    [
        ({"bldg:measuredHeight": 12.0}, 12.0, None),
        ({"properties.height": 12.0}, 12.0, None),
        ({"Height (m)": 12.0}, 12.0, None),
        ({"Height [ft]": 100.0}, 30.48, None),
        ({"height_mm": 12_000}, 12.0, None),
        ({"height": "~12,5 m"}, 12.5, None),
        ({"height": "1250 cm"}, 12.5, None),
        ({"高度": 12.0}, 12.0, None),
        ({"высота": 12.0}, 12.0, None),
        ({"høyde": 12.0}, 12.0, None),
        ({"层数": 4}, None, 4),
        ({"этажность": 4}, None, 4),
        ({"pavimentos": 4}, None, 4),
        ({"numPlantas": 4}, None, 4),
        ({"nombre_d_etages": 4}, None, 4),
        ({"liczbaKondygnacji": 4}, None, 4),
        ({"BuildingHeight": 12.0, "NumStoreys": 4}, 12.0, 4),
        ({"anzahlgs": 4}, None, 4),
        ({"PocetPodlazi": 4}, None, 4),
        ({"i_kerrlkm": 4}, None, 4),
        ({"floors": "4 storeys"}, None, 4),
        ({"floors": "G+3"}, None, 4),
        ({"floors": "4+1"}, None, 4),
    ],
)
def test_heights_and_storeys_of_many_maps(
    tmp_path: Path, columns: dict[str, Any], height: float | None, levels: int | None
) -> None:
    found = read_vector_footprints(outline(tmp_path / "b.gpkg", columns))
    assert found.items[0].height == (None if height is None else pytest.approx(height, abs=0.01))
    assert found.items[0].levels == levels
    assert found.remarks == ()


def test_ground_of_other_maps(tmp_path: Path) -> None:
    found = read_vector_footprints(outline(tmp_path / "b.gpkg", {"hauteur": 12.0, "altitude_minimale_sol": 20.0}))
    assert found.items[0].base == 20.0


@pytest.mark.parametrize("columns", [{"o_kote": 182.0}, {"wysokosc_bud": 12.5, "Höhe_über_Grund": 12}])
def test_unknown_columns_of_numbers_are_named(tmp_path: Path, columns: dict[str, Any]) -> None:
    found = read_vector_footprints(outline(tmp_path / "b.gpkg", columns))
    assert [remark.id for remark in found.remarks] == list(columns)


def test_storeys_that_are_not_understood_are_named(tmp_path: Path) -> None:
    found = read_vector_footprints(outline(tmp_path / "b.gpkg", {"levels": "several"}))
    assert [(one.id, one.reason) for one in found.remarks] == [("0 (several)", "storeys not understood and ignored")]


def test_railways_of_overture_are_no_streets(tmp_path: Path) -> None:
    lines = [shapely.LineString([(0, y), (90, y)]) for y in (0, 30)]
    columns = {"id": ["a", "b"], "subtype": ["road", "rail"], "class": ["residential", "subway"]}
    geopandas.GeoDataFrame(columns, geometry=lines, crs="EPSG:32635").to_file(tmp_path / "s.gpkg")
    assert [street.id for street in read_vector_centrelines(tmp_path / "s.gpkg").items] == ["a"]


@pytest.mark.parametrize(
    ("name", "remedy"), [("b.zip", "unpack it"), ("b.osm", "osmium cat"), ("b.ifc", "IfcConvert"), ("b.b3dm", "tile")]
)
def test_files_that_are_not_read_name_the_remedy(tmp_path: Path, name: str, remedy: str) -> None:
    with pytest.raises(InputError, match=remedy):
        read_buildings(tmp_path / name)


@pytest.mark.parametrize(
    ("columns", "height", "roof_height", "is_eaves"),
    [
        ({"RelH2": 6.4, "RelHMax": 9.2}, 6.4, 2.8, True),
        ({"eave_height": 6.4}, 6.4, None, True),
        ({"eaves_height_ft": 20.0}, 6.096, None, True),
        ({"height_relativemax_m": 9.2, "height_relativeroofbase_m": 6.4}, 6.4, 2.8, True),
        ({"relhmax": 9.2}, 9.2, None, False),
        ({"hauteur": 9.0, "z_min_sol": 40.0}, 9.0, None, True),
        ({"hauteur": 9.0}, 9.0, None, False),
    ],
)
def test_heights_of_eaves(
    tmp_path: Path, columns: dict[str, Any], height: float, roof_height: float | None, is_eaves: bool
) -> None:
    (item,) = read_vector_footprints(outline(tmp_path / "b.gpkg", columns)).items
    assert (item.height, item.roof_height, item.is_eaves_height) == (pytest.approx(height), roof_height, is_eaves)


@pytest.mark.parametrize(
    ("word", "shape"),
    [
        ("Flachdach", "flat"), ("Satteldach", "gabled"), ("Walmdach", "hipped"), ("3200", "hipped"), ("1000", "flat"),
        ("Flat roof", "flat"), ("Hip Roof", "hipped"), ("zadeldak", "gabled"), ("dome", "dome"),
        ("complex", None), ("9999", None),
    ],
)  # fmt: skip
def test_roof_shapes_of_other_maps(tmp_path: Path, word: str, shape: str | None) -> None:
    found = read_vector_footprints(outline(tmp_path / "b.gpkg", {"hoehe": 12.0, "dachform": word}))
    roof = found.items[0].roof
    assert (None if roof is None else roof.shape) == shape
    assert [remark.id for remark in found.remarks] == (["0 (complex)"] if word == "complex" else [])


def test_widths_of_streets_that_are_no_length_are_noted(tmp_path: Path) -> None:
    lines = [shapely.LineString([(0, y), (50, y)]) for y in (0, 10, 20)]
    columns = {"name": ["a", "b", "c"], "width": ["7ft 6in", "6-8 m", "['7', '8']"]}
    geopandas.GeoDataFrame(columns, geometry=lines, crs="EPSG:32635").to_file(tmp_path / "s.gpkg")
    found = read_vector_centrelines(tmp_path / "s.gpkg")
    assert [remark.id for remark in found.remarks] == ["1 (6-8 m)"]
