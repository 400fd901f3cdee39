"""Vector files: columns of many names, frames, layers, broken features, and the real extracts."""

from __future__ import annotations

import json
import math
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pandas
import pytest
import shapely
from shapely import LineString, MultiLineString, Point, Polygon

from catalogs.readers.formats import read_buildings
from catalogs.readers.source_keys import SourceKeys
from catalogs.readers.vectors import osm
from catalogs.readers.vectors.vector_files import read_vector_centrelines, read_vector_footprints
from facade_core.core.errors import InputError
from facade_core.core.types import Roof


def square(x: float = 0.0, y: float = 0.0) -> Polygon:
    return shapely.box(x, y, x + 10, y + 10)


def frame(geometries: list[Any], crs: str | None = "EPSG:3067", **columns: list[Any]) -> geopandas.GeoDataFrame:
    return geopandas.GeoDataFrame(columns, geometry=geometries, crs=crs)


def geojson(path: Path, features: list[tuple[Any, dict[str, Any]]], **members: Any) -> Path:
    rows = [{"type": "Feature", "properties": properties, "geometry": g} for g, properties in features]
    path.write_text(json.dumps({"type": "FeatureCollection", **members, "features": rows}))
    return path


SUFFIXES = [".gpkg", ".geojson", ".parquet", ".shp", ".fgb"]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_says_the_same(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"buildings{suffix}"
    columns = {
        "id": ["a", "b"],
        "height": [12.5, None],
        "levels": [None, 4],
        "name": ["Hall", ""],
        "roof:shape": ["flat", "gabled"],
    }
    source = frame([square(385_000, 6_672_000), square(385_050, 6_672_000)], **columns)
    if suffix == ".geojson":
        source = source.to_crs(4326)
    source.to_parquet(path) if suffix == ".parquet" else source.to_file(path)
    found = read_vector_footprints(path)
    assert found.crs == ("EPSG:4326" if suffix == ".geojson" else "EPSG:3067")
    items = sorted(found.items, key=lambda f: f.id)  # FlatGeobuf orders by place
    assert [(f.id, f.height, f.levels, f.name) for f in items] == [
        ("a", 12.5, None, "Hall"),
        ("b", None, 4.0, None),
    ]
    assert items[0].roof == Roof("flat", 0.0)
    assert items[1].roof is not None
    assert items[1].roof.height == pytest.approx(5 * math.tan(math.radians(30)), abs=0.02)
    assert (found.remarks, found.faults) == ((), ())


@pytest.mark.parametrize(
    ("column", "value", "height", "levels"),
    [
        ("HEIGHT", "12 m", 12.0, None),
        ("Height_M", 7, 7.0, None),
        ("measuredHeight", 9.25, 9.25, None),
        ("height_ft", 40, 12.192, None),
        ("building:levels", "4;5", None, 5.0),
        ("storeysAboveGround", 3.0, None, 3.0),
        ("num_floors", "6", None, 6.0),
        ("other_tags", '"height"=>"40 ft","building:levels"=>"3"', 12.192, 3.0),
        ("tags", '{"height": "8", "note": "x"}', 8.0, None),
        ("colour", "12", None, None),
    ],
)
def test_columns_of_many_names(
    tmp_path: Path, column: str, value: Any, height: float | None, levels: float | None
) -> None:
    path = tmp_path / "a.gpkg"
    frame([square()], **{column: [value]}).to_file(path)
    (found,) = read_vector_footprints(path).items
    assert found.height == (None if height is None else pytest.approx(height))
    assert found.levels == levels


def test_heights_above_the_datum_are_taken_off_the_ground(tmp_path: Path) -> None:
    path = tmp_path / "pand.gpkg"
    frame([square()], b3_h_maaiveld=[1.5], b3_h_dak_70p=[13.0], identificatie=["NL.IMBAG.Pand.1"]).to_file(path)
    (found,) = read_vector_footprints(path).items
    assert (found.id, found.height, found.base) == ("NL.IMBAG.Pand.1", 11.5, 1.5)


def test_roof_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    columns = {"roof_shape": ["skillion"], "roof_height": [2.0], "roof_direction": ["E"], "height": [10.0]}
    frame([square()], **columns).to_file(path)
    (found,) = read_vector_footprints(path).items
    assert (found.height, found.roof) == (8.0, Roof("skillion", 2.0, 90.0))


@pytest.mark.parametrize(
    ("columns", "ids"),
    [
        ({"id": [7, 8, 9]}, ["7", "8", "9"]),
        ({"id": [1.0, 1.0, 2.0], "gml_id": ["x", "y", "z"]}, ["x", "y", "z"]),
        ({"id": ["a", None, "b"]}, ["a", "row-1", "b"]),
        ({"osm_id": ["1", None, "2"], "osm_way_id": [None, "1", None]}, ["r1", "w1", "r2"]),
        ({"@id": ["way/5", "relation/5", "way/6"]}, ["w5", "r5", "w6"]),
        ({"element": ["way", "relation", "way"], "osmid": [5, 5, 6]}, ["w5", "r5", "w6"]),
    ],
)
def test_ids_are_unique(tmp_path: Path, columns: dict[str, list[Any]], ids: list[str]) -> None:
    path = tmp_path / "a.parquet"
    frame([square(), square(20), square(40)], **columns).to_parquet(path)
    assert [found.id for found in read_vector_footprints(path).items] == ids


HUGE = 2**53 + 1


@pytest.mark.parametrize(
    ("stated", "ids"),
    [
        (["2020-01-01", "2020-01-02", "x"], ["2020-01-01", "2020-01-02", "x"]),
        (["2020-01-01", "2020-01-02", "2020/01/03"], ["2020-01-01", "2020-01-02", "2020/01/03"]),
        (["2020-01-01", "2020-01-02", None], ["2020-01-01", "2020-01-02", "row-2"]),
        (["12:30:00", "12:30:01", "1:2:3"], ["12:30:00", "12:30:01", "1:2:3"]),
        (["2020-01-01T10:00:00Z", "2020-01-01T12:00:00+02:00", "b"],) * 2,
        (["1e5", "007", "7"], ["1e5", "007", "7"]),
        ([HUGE, HUGE + 1, HUGE + 2], [str(HUGE), str(HUGE + 1), str(HUGE + 2)]),
        ([HUGE, None, HUGE + 1], [str(HUGE), "row-1", str(HUGE + 1)]),
        ([10**15 + 1, 1.5, 2], ["1000000000000001", "1.5", "2"]),
        ([HUGE, "a", "b"], [str(HUGE), "a", "b"]),
    ],
)
@pytest.mark.parametrize("column", ["id", "osm_id", "fid"])
def test_ids_of_geojson_are_what_it_states(tmp_path: Path, stated: list[Any], ids: list[str], column: str) -> None:
    features = [
        (shapely.geometry.mapping(square(20.0 * row)), {} if id is None else {column: id, "name": id})
        for row, id in enumerate(stated)
    ]
    found = read_vector_footprints(geojson(tmp_path / "a.geojson", features))
    assert [footprint.id for footprint in found.items] == ids
    assert [footprint.name for footprint in found.items if footprint.name] == [id for id in ids if "row" not in id]
    assert found.remarks == ()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_integers_of_over_53_bits_and_dates_are_whole_in_every_format(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    ids = pandas.array([HUGE, None, HUGE + 1], dtype="Int64")
    days = pandas.to_datetime(["2020-01-01", "2020-01-02", "2020-01-03"]).date
    source = frame([square(), square(20), square(40)], id=ids, name=days)
    if suffix == ".geojson":
        source = source.to_crs(4326)
    source.to_parquet(path) if suffix == ".parquet" else source.to_file(path)
    items = read_vector_footprints(path).items
    assert {str(HUGE), str(HUGE + 1)} < {item.id for item in items}
    assert sorted(str(item.name) for item in items) == ["2020-01-01", "2020-01-02", "2020-01-03"]


@pytest.mark.parametrize("stated", [[2**70, 5, 6], [HUGE, 1.5, 2], [1, "a", 2**70 + 1]])
def test_an_id_that_cannot_be_held_whole_is_remarked_on(tmp_path: Path, stated: list[Any]) -> None:
    features = [(shapely.geometry.mapping(square(20.0 * row)), {"id": id}) for row, id in enumerate(stated)]
    (remark,) = read_vector_footprints(geojson(tmp_path / "a.geojson", features)).remarks
    assert remark.reason == "buildings of a.geojson whose id is a number too large to be held whole; write it as text"
    assert "e+" in remark.id or remark.id.endswith(".0")


def test_buildings_of_one_id_are_remarked_on(tmp_path: Path) -> None:
    places = [shapely.geometry.mapping(square(20.0 * row)) for row in range(4)]
    rows = [{"id": id} for id in ("x", "y", "x", "z")]
    found = read_vector_footprints(geojson(tmp_path / "a.geojson", list(zip(places, rows, strict=True))))
    assert [footprint.id for footprint in found.items] == ["x", "y", "x-2", "z"]
    assert [(r.id, r.reason) for r in found.remarks] == [
        ("x-2", "buildings of a.geojson numbered since another has their id")
    ]
    found = read_vector_footprints(geojson(tmp_path / "b.geojson", [(place, {"id": "x"}) for place in places]))
    assert [footprint.id for footprint in found.items] == ["0", "1", "2", "3"]
    reason = "buildings of b.geojson named by their row, since too few have an id of their own"
    assert [(r.id, r.reason) for r in found.remarks] == [(str(row), reason) for row in range(4)]


def test_streets_of_one_id_are_remarked_on_unless_they_are_pieces_of_one(tmp_path: Path) -> None:
    lines = [shapely.geometry.mapping(LineString([(x, 0), (x, 50)])) for x in range(0, 100, 10)]
    rows = [
        {"osm_id": id, "name": name}
        for id, name in (("1", "A"), ("1", "A"), ("2", "B"), ("2", "C"), ("3", None), ("3", None))
    ]
    rows += [{"osm_id": str(id), "name": "D"} for id in range(4, 8)]
    found = read_vector_centrelines(geojson(tmp_path / "a.geojson", list(zip(lines, rows, strict=True))))
    assert [piece.id for piece in found.items][:6] == ["1", "1-2", "2", "2-2", "3", "3-2"]
    assert [(r.id, r.reason) for r in found.remarks] == [
        (id, "streets of a.geojson numbered since another has their id") for id in ("2-2", "3-2")
    ]


def test_overture_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    columns = {"id": ["u1", "u2"], "names": [{"primary": "Ateneum"}, None], "num_floors": [4, None]}
    frame([square(), square(20)], **columns, is_underground=[False, False]).to_parquet(path)
    assert [(f.id, f.name, f.levels) for f in read_vector_footprints(path).items] == [
        ("u1", "Ateneum", 4.0),
        ("u2", None, None),
    ]


def test_broken_outlines_are_faults_and_the_rest_is_read(tmp_path: Path) -> None:
    nan = Polygon([(0, 0), (math.nan, 5), (5, 5)])
    bow = Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
    path = tmp_path / "a.gpkg"
    geometries = [nan, None, Polygon(), bow, square()]
    frame(geometries, id=list("abcde"), height=[3.0, 3.0, 3.0, -1.0, 0.0]).to_file(path)
    found = read_vector_footprints(path)
    assert [f.id for f in found.items] == ["d", "e"], "an outline that crosses itself is left to the block"
    assert [(f.id, f.kind) for f in found.faults] == [("a", "building"), ("b", "building"), ("c", "building")]
    assert found.faults[0].place.bounds == (0, 0, 5, 5)
    assert [r.reason for r in found.remarks] == ["heights not understood and ignored"] * 2


def test_a_ring_that_does_not_close_loses_only_itself(tmp_path: Path) -> None:
    broken = {"type": "Polygon", "coordinates": [[[0, 0], [1, 0]]]}
    path = geojson(tmp_path / "a.geojson", [(broken, {"id": "x"}), (shapely.geometry.mapping(square()), {"id": "y"})])
    found = read_vector_footprints(path)
    assert [f.id for f in found.items] == ["y"]
    assert [f.id for f in found.faults] == ["x"]


def test_parts_are_read_and_other_outlines_set_aside(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    columns = {"building": ["yes", "yes", "roof", None, None], "min_height": [None, 6.0, None, None, 3.0]}
    part = [None, None, None, None, "yes"]
    frame([square(20 * i) for i in range(5)], id=list("abcde"), building_part=part, **columns).to_file(path)
    found = read_vector_footprints(path)
    assert [(f.id, f.is_part, f.min_height) for f in found.items] == [
        ("a", False, None),
        ("b", False, 6.0),
        ("e", True, 3.0),
    ]
    assert [r.reason for r in found.remarks] == [
        "roofs without walls set aside",
        "outlines that are not tagged as buildings set aside",
    ]


def test_z_is_the_ground_where_all_have_it(tmp_path: Path) -> None:
    high = [shapely.force_3d(square(20 * i), 4.0 + i) for i in range(2)]
    for name, geometries, bases in [
        ("all", high, [4.0, 5.0]),
        ("some", [high[0], square(20)], [None, None]),
        ("zero", [shapely.force_3d(square(), 0.0)], [None]),
    ]:
        path = tmp_path / f"{name}.parquet"
        frame(geometries).to_parquet(path)
        found = read_vector_footprints(path)
        assert [f.base for f in found.items] == bases
        assert not any(f.outline.has_z for f in found.items)


def test_a_solid_drawn_as_faces_keeps_them_and_covers_its_outline(tmp_path: Path) -> None:
    ring = [(0, 0, 2), (10, 0, 2), (10, 10, 2), (0, 10, 2)]
    faces = [Polygon(ring), Polygon([(x, y, 9) for x, y, _ in ring])]
    faces += [Polygon([a, b, (*b[:2], 9), (*a[:2], 9)]) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)]
    path = tmp_path / "solid.parquet"
    frame([shapely.multipolygons([faces])[0]]).to_parquet(path)
    (found,) = read_vector_footprints(path).items
    assert found.outline.area == pytest.approx(100)
    assert found.base == 2.0
    assert found.shell is not None
    assert np.ptp(found.shell.vertices[:, 2]) == 7.0


def test_layers_are_told_apart_by_kind_and_name(tmp_path: Path) -> None:
    path = tmp_path / "city.gpkg"
    frame([square(90)], id=["lake"]).to_file(path, layer="water")
    frame([square()], id=["house"]).to_file(path, layer="Buildings")
    frame([LineString([(0, 0), (9, 9)])], id=["river"]).to_file(path, layer="rivers")
    frame([LineString([(0, 0), (9, 0)])], id=["road"]).to_file(path, layer="roads_2024")
    found = read_vector_footprints(path)
    assert [f.id for f in found.items] == ["house"]
    assert [(r.id, r.reason.partition(";")[0]) for r in found.remarks] == [
        ("Buildings, not water", "layers read of files that have several")
    ]
    streets = read_vector_centrelines(path)
    assert [piece.id for piece in streets.items] == ["road"]
    assert [remark.id for remark in streets.remarks] == ["roads_2024, not rivers"]
    assert not read_vector_centrelines(path, SourceKeys(layer="roads_2024")).remarks
    with pytest.raises(InputError, match=r"no layer rivers of outlines; write as layer one of: water, Buildings"):
        read_vector_footprints(path, keys=SourceKeys(layer="rivers"))


def test_geojson_frames(tmp_path: Path) -> None:
    metres = [(shapely.geometry.mapping(square(385_000, 6_672_000)), {})]
    degrees = [(shapely.geometry.mapping(shapely.box(24, 60, 24.001, 60.001)), {})]
    member = {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3067"}}}
    assert read_vector_footprints(geojson(tmp_path / "a.geojson", metres)).crs is None
    assert read_vector_footprints(geojson(tmp_path / "b.geojson", metres, **member)).crs == "EPSG:3067"
    assert read_vector_footprints(geojson(tmp_path / "c.json", degrees)).crs == "EPSG:4326"


def test_a_file_without_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    frame([square()], crs=None).to_file(path)
    assert read_vector_footprints(path).crs is None


def test_empty_files_hold_nothing(tmp_path: Path) -> None:
    path = geojson(tmp_path / "a.geojson", [])
    assert read_vector_footprints(path).items == ()
    assert read_vector_centrelines(path).items == ()


def test_centrelines_of_openstreetmap(tmp_path: Path) -> None:
    path = tmp_path / "streets.gpkg"
    kinds = ["residential", "footway", "service", "['service', 'tertiary']", None, "primary", "pedestrian"]
    lines: list[Any] = [LineString([(0, 10 * i), (9, 10 * i)]) for i in range(len(kinds) - 1)]
    lines.append(LineString([(0, 90), (9, 90), (9, 99), (0, 90)]))
    columns = {
        "highway": kinds,
        "tunnel": [None] * 5 + ["yes", None],
        "name": ["A", "", None, "['B', 'C']", "", "", ""],
    }
    frame(lines, id=list("abcdefg"), **columns).to_file(path)
    found = read_vector_centrelines(path)
    assert [(piece.id, piece.name) for piece in found.items] == [("a", "A"), ("d", "B")]
    assert found.faults == ()


def test_tunnels_are_no_streets_where_no_class_is_stated(tmp_path: Path) -> None:
    path = tmp_path / "streets.gpkg"
    lines = [LineString([(0, 10 * i), (9, 10 * i)]) for i in range(3)]
    frame(lines, id=list("abc"), tunnel=["T", "F", None]).to_file(path)
    assert [piece.id for piece in read_vector_centrelines(path).items] == ["b", "c"]


def test_parts_are_numbered_broken_lines_are_faults_and_directions_one(tmp_path: Path) -> None:
    path = tmp_path / "streets.parquet"
    one, two = LineString([(0, 0), (9, 0)]), LineString([(20, 0), (29, 0)])
    lines = [
        MultiLineString([one, two]),
        one.reverse(),
        LineString([(5, 5), (5, 5)]),
        LineString([(0, 1), (math.nan, 2)]),
        None,
    ]
    frame(lines, id=list("abcde")).to_parquet(path)
    found = read_vector_centrelines(path)
    assert [piece.id for piece in found.items] == ["a-0", "a-1"]
    assert [(fault.id, fault.kind) for fault in found.faults] == [("c", "street"), ("d", "street"), ("e", "street")]
    assert ["no length" in fault.reason for fault in found.faults] == [True, False, False]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_broken_files_are_refused_by_name(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(b"nothing of the kind")
    for read in (read_vector_footprints, read_vector_centrelines):
        with pytest.raises(InputError, match=rf"broken\{suffix}"):
            read(path)


def test_the_wrong_kind_of_geometry_is_refused(tmp_path: Path) -> None:
    lines, points = tmp_path / "lines.gpkg", tmp_path / "points.geojson"
    frame([LineString([(0, 0), (9, 0)])]).to_file(lines)
    geojson(points, [(shapely.geometry.mapping(Point(1, 2)), {})])
    with pytest.raises(InputError, match="holds no outlines but lines"):
        read_vector_footprints(lines)
    with pytest.raises(InputError, match="holds no lines but"):
        read_vector_centrelines(points)


def test_helsinki_as_geopackage_and_as_pbf(data: Path) -> None:
    city = data / "city/helsinki"
    package, extract = (
        read_vector_footprints(city / "buildings_lod1.gpkg"),
        osm.read_osm_footprints(city / "Helsinki.osm.pbf"),
    )
    one, two = ({f.id: f for f in source.items} for source in (package, extract))
    # the package has no parts and no column of min_height, keeps outlines that the extract cuts
    assert len(one) == 478
    assert len(two) == 559
    assert not {id for id in two.keys() - one.keys() if not two[id].is_part}
    assert len(one.keys() - two.keys()) == 45
    shared = one.keys() & two.keys()
    assert all(one[id].height == two[id].height or two[id].roof for id in shared)
    assert all(one[id].name == two[id].name for id in shared)
    streets, ways = read_vector_centrelines(city / "streets.gpkg"), osm.read_osm_centrelines(city / "Helsinki.osm.pbf")
    assert streets.crs == "EPSG:3067"
    ids = {f"w{piece.id}" for piece in streets.items}, {piece.id for piece in ways.items}
    # the package has no links between carriageways and no column that tells tunnels
    assert len(ids[1] - ids[0]) == 9
    assert len(ids[0] - ids[1]) == 21
    assert len(ids[0] & ids[1]) == 715


def test_opendrive_outside_junctions(data: Path) -> None:
    found = read_vector_centrelines(data / "city/ingolstadt/centrelines_opendrive.geojson")
    assert found.crs == "EPSG:25832"
    assert len(found.items) == 20
    assert found.faults == ()


def _emptied(table: Path) -> None:
    table.write_bytes(b"")


def _made_a_folder(table: Path) -> None:
    table.unlink()
    table.mkdir()


def _of_fewer_rows(table: Path) -> None:
    data = bytearray(table.read_bytes())
    data[4:8] = struct.pack("<I", 2)
    table.write_bytes(data)


@pytest.mark.parametrize(
    ("wound", "words"),
    [
        (Path.unlink, "has no b.dbf beside it"),
        (_made_a_folder, "has no b.dbf beside it"),
        (_emptied, "b.dbf is no dBASE table"),
        (lambda table: table.write_bytes(bytes(500)), "b.dbf is no dBASE table"),
        (lambda table: table.write_bytes(table.read_bytes()[:-60]), "b.dbf is cut: "),
        (lambda table: table.write_bytes(table.read_bytes()[:40]), "b.dbf is cut: "),
        (_of_fewer_rows, "b.dbf holds 2 rows for the 3 shapes of b.shp"),
    ],
)
def test_a_shapefile_without_its_whole_table_is_refused(
    wound: Callable[[Path], object], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "b.shp"
    frame([square(20 * x) for x in range(3)], id=["a", "b", "c"], height=[7.0, 8.0, 9.0]).to_file(path)
    assert [item.height for item in read_vector_footprints(path).items] == [7.0, 8.0, 9.0]
    wound(tmp_path / "b.dbf")
    with pytest.raises(InputError) as refusal:
        read_vector_footprints(path)
    assert words in str(refusal.value)
    assert "; copy it again" in str(refusal.value)


def test_a_shapefile_in_capitals_has_its_table(tmp_path: Path) -> None:
    frame([square()], id=["a"], height=[7.0]).to_file(tmp_path / "b.shp")
    for part in list(tmp_path.iterdir()):
        part.rename(part.with_name(part.name.upper()))
    assert [(item.id, item.height) for item in read_vector_footprints(tmp_path / "B.SHP").items] == [("a", 7.0)]


@pytest.mark.parametrize(
    ("odd", "height"),
    [
        ([3], 3.0),
        (["3"], 3.0),
        ([3.5], 3.5),
        ([3, 4], None),
        ([], None),
        ([[3]], None),
        ([None], None),
        ({"a": 1}, None),
        ("x", None),
    ],
)
def test_one_odd_height_leaves_the_others_as_they_are(odd: Any, height: float | None, tmp_path: Path) -> None:
    heights = {"a": 7.0, "b": 9.5, "c": odd}
    places = enumerate(heights.items())
    features = [
        (shapely.box(x, 60, x + 1e-4, 60.0001).__geo_interface__, {"id": i, "height": h}) for x, (i, h) in places
    ]
    path = geojson(tmp_path / "b.geojson", features)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read_vector_footprints(path)
    assert [(item.id, item.height) for item in found.items] == [("a", 7.0), ("b", 9.5), ("c", height)]
    assert {remark.id.split()[0] for remark in found.remarks} <= {"c"}


DEGREES = Polygon([(24.95, 60.17), (24.9502, 60.17), (24.9502, 60.1702), (24.95, 60.1702)])


def test_a_corner_far_away_does_not_hide_degrees(tmp_path: Path) -> None:
    far = shapely.Polygon([(24.95, 60.17), (1e300, 60.17), (24.951, 60.171)])
    geopandas.GeoDataFrame({"id": ["a", "b"]}, geometry=[DEGREES, far], crs="EPSG:4326").to_file(tmp_path / "a.geojson")
    found = read_vector_footprints(tmp_path / "a.geojson")
    assert found.crs == "EPSG:4326"
    assert [item.id for item in found.items] == ["a"]
    assert [fault.id for fault in found.faults] == ["b"]


def test_swapped_degrees_beyond_90_stay_degrees(tmp_path: Path) -> None:
    swapped = shapely.transform(DEGREES, lambda xy: xy[:, ::-1] + np.array([-94.0, 126.0]))  # Sydney: -33.8, 151
    geopandas.GeoDataFrame({"id": ["a"]}, geometry=[swapped], crs="EPSG:4326").to_file(tmp_path / "a.geojson")
    assert read_vector_footprints(tmp_path / "a.geojson").crs == "EPSG:4326"


def test_points_of_a_collection_are_not_the_ground_of_its_outline(tmp_path: Path) -> None:
    solid = shapely.force_3d(DEGREES, 68.0)
    both = shapely.GeometryCollection([solid, shapely.Point(24.95, 60.17, 0.0)])
    geopandas.GeoDataFrame({"id": ["a", "b"]}, geometry=[solid, both], crs="EPSG:4326").to_file(tmp_path / "a.geojson")
    assert [item.base for item in read_vector_footprints(tmp_path / "a.geojson").items] == [68.0, 68.0]


@pytest.mark.parametrize(
    ("head", "of"),
    [
        ({"exceededTransferLimit": True}, "1 in b.geojson"),
        ({"properties": {"exceededTransferLimit": True}}, "1 in b.geojson"),
        ({"numberMatched": 5000, "numberReturned": 1}, "1 of 5000 in b.geojson"),
        ({"totalFeatures": 1, "numberMatched": 1}, None),
        ({"totalFeatures": "unknown"}, None),
    ],
)
def test_a_download_that_was_cut_is_noted(tmp_path: Path, head: dict[str, object], of: str | None) -> None:
    feature = {
        "type": "Feature",
        "properties": {"height": 9.5},
        "geometry": shapely.box(24, 60, 24.001, 60.001).__geo_interface__,
    }
    (tmp_path / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature], **head}))
    remarks = read_vector_footprints(tmp_path / "b.geojson").remarks
    assert [remark.id for remark in remarks] == ([] if of is None else [of])


@pytest.mark.parametrize(
    ("key", "name"), [("geometryType", "Esri JSON"), ("arcs", "TopoJSON"), ("elements", "Overpass")]
)
def test_other_json_of_maps_is_named(tmp_path: Path, key: str, name: str) -> None:
    (tmp_path / "b.json").write_text(json.dumps({key: [], "features": []}))
    with pytest.raises(InputError, match=f"it is .*{name}"):
        read_buildings(tmp_path / "b.json")


def write_layers(path: Path) -> Path:
    """A GeoPackage of outlines without heights and of solids of 9 m, each in a layer of its own."""
    import geopandas
    from shapely import MultiPolygon, Polygon

    ring = [(0.0, 0.0), (12.0, 0.0), (12.0, 6.0), (0.0, 6.0)]
    faces = [Polygon([(x, y, z) for x, y in ring]) for z in (0.0, 9.0)]
    for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]], strict=True):
        faces.append(Polygon([(x0, y0, 0.0), (x1, y1, 0.0), (x1, y1, 9.0), (x0, y0, 9.0)]))
    for layer, geometry in (
        ("pand", Polygon(ring)),
        ("lod12_3d", MultiPolygon(faces)),
        ("lod22_3d", MultiPolygon(faces)),
    ):
        frame = geopandas.GeoDataFrame({"id": ["a"]}, geometry=[geometry], crs="EPSG:28992")
        frame.to_file(path, layer=layer, driver="GPKG")
    return path


def test_solids_are_read_before_outlines_and_the_others_are_named(tmp_path: Path) -> None:
    found = read_vector_footprints(write_layers(tmp_path / "a.gpkg"))
    assert found.items[0].shell is not None
    assert "lod22_3d, not pand, lod12_3d" in [remark.id for remark in found.remarks]


def test_a_key_chooses_the_layer(tmp_path: Path) -> None:
    path = write_layers(tmp_path / "a.gpkg")
    assert read_vector_footprints(path, keys=SourceKeys(layer="pand")).items[0].shell is None
    with pytest.raises(
        InputError, match="has no layer lod13 of outlines; write as layer one of: pand, lod12_3d, lod22_3d"
    ):
        read_vector_footprints(path, keys=SourceKeys(layer="lod13"))
