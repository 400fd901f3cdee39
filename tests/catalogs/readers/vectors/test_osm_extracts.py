"""Extracts that lack nodes or ways: nothing is built of what is left, and notes name it."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.crs import utm_crs
from catalogs.readers.vectors import osm
from facade_core.core.errors import InputError
from tests.catalogs.readers.vectors.osm_files import OsmFile, Packing, lonlat

HOUSE = {"building": "yes", "height": "9"}


def make_extract() -> OsmFile:
    """A house w10, a courtyard house r31 of outer way 30 and inner way 32, and a street w21 with a corner."""
    made = OsmFile()
    made.add_ring(10, (0, 0, 12, 6), HOUSE)
    made.add_ring(30, (20, 0, 50, 30), {})
    made.add_ring(32, (30, 10, 40, 20), {})
    made.relations[31] = ([("outer", 30), ("inner", 32)], {**HOUSE, "type": "multipolygon"})
    made.nodes |= {i: lonlat(*place) for i, place in enumerate([(0, -5), (50, -5), (50, -45)], 1)}
    made.ways[21] = ([1, 2, 3], {"highway": "residential", "name": "Street"})
    return made


def read_areas(path: Path) -> dict[str, float]:
    transform = utm_crs(24.9, 60.2)
    import geopandas

    found = osm.read_osm_footprints(path).items
    return dict(
        zip(
            [one.id for one in found],
            geopandas.GeoSeries([one.outline for one in found], crs=4326).to_crs(transform).area.round(-1).tolist(),
            strict=True,
        )
    )


def read_notes(path: Path) -> dict[str, str]:
    remarks = (*osm.read_osm_footprints(path).remarks, *osm.read_osm_centrelines(path).remarks)
    return {remark.id: remark.reason for remark in remarks}


@pytest.mark.parametrize("packing", ["raw", "zlib", "lz4", "zstd"])
def test_whole_extracts_are_read_in_every_packing(tmp_path: Path, packing: Packing) -> None:
    path = make_extract().write(tmp_path / "city.osm.pbf", packing)
    assert read_areas(path) == {"w10": 70.0, "r31": 800.0}
    [street] = osm.read_osm_centrelines(path).items
    assert len(street.line.coords) == 3
    assert not read_notes(path)


def test_relation_without_its_outer_way_is_no_house(tmp_path: Path) -> None:
    made = make_extract()
    del made.ways[30]
    path = made.write(tmp_path / "city.osm.pbf")
    assert read_areas(path) == {"w10": 70.0}
    assert "osmium extract -s smart" in read_notes(path)["r31"]


def test_relation_without_its_inner_way_keeps_no_full_courtyard(tmp_path: Path) -> None:
    made = make_extract()
    del made.ways[32]
    assert read_areas(made.write(tmp_path / "city.osm.pbf")) == {"w10": 70.0}


def test_relation_of_a_cut_way_is_left_out(tmp_path: Path) -> None:
    made = make_extract()
    del made.nodes[321]
    path = made.write(tmp_path / "city.osm.pbf")
    assert read_areas(path) == {"w10": 70.0}
    assert set(read_notes(path)) == {"r31"}


def test_relation_without_any_way_is_noted(tmp_path: Path) -> None:
    made = make_extract()
    del made.ways[30], made.ways[32]
    path = made.write(tmp_path / "city.osm.pbf")
    assert read_areas(path) == {"w10": 70.0}
    assert set(read_notes(path)) == {"r31"}


@pytest.mark.parametrize("absent", [1, 2, 3])
def test_street_that_lacks_a_node_is_left_out(tmp_path: Path, absent: int) -> None:
    made = make_extract()
    del made.nodes[absent]
    path = made.write(tmp_path / "city.osm.pbf")
    assert not osm.read_osm_centrelines(path).items
    assert set(read_notes(path)) == {"w21"}


def test_house_that_lacks_a_corner_is_left_out(tmp_path: Path) -> None:
    made = make_extract()
    del made.nodes[102]
    path = made.write(tmp_path / "city.osm.pbf")
    assert read_areas(path) == {"r31": 800.0}
    assert set(read_notes(path)) == {"w10"}


@pytest.mark.parametrize("packing", ["zlib", "lz4"])
def test_extracts_without_nodes_are_refused_with_the_filter(tmp_path: Path, packing: Packing) -> None:
    made = make_extract()
    made.nodes.clear()
    path = made.write(tmp_path / "city.osm.pbf", packing)
    with pytest.raises(InputError, match=r"city.osm.pbf lacks the nodes of its ways; .*--omit-referenced"):
        osm.read_osm_footprints(path)


def test_locations_on_ways_are_refused_with_their_option(tmp_path: Path) -> None:
    made = make_extract()
    made.nodes = {2: made.nodes[2]}  # osmium keeps nodes with tags
    path = made.write(tmp_path / "city.osm.pbf", optional=["LocationsOnWays"])
    with pytest.raises(InputError, match="add-locations-to-ways --keep-untagged-nodes"):
        osm.read_osm_centrelines(path)


def test_histories_are_refused_with_their_remedy(tmp_path: Path) -> None:
    path = make_extract().write(tmp_path / "city.osh.pbf", required=["HistoricalInformation"])
    with pytest.raises(InputError, match=r"holds all versions of its features; .* osmium time-filter"):
        osm.read_osm_footprints(path)
