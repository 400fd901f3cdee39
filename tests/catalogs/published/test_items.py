"""items.parquet: what is written comes back, and a wrong row is refused by name."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, from_wkb, from_wkt

from catalogs.features import natural_sort_key
from catalogs.published.columns import BBOX, COLUMNS, ROW_KEYS, ItemColumn
from catalogs.published.items import write_items
from facade_core.core.errors import InputError


def row(number: int, **changes: Any) -> dict[str, Any]:
    """A facade 15 m wide in central Helsinki, every further one 20 m east of the one before."""
    x = 385_700 + 20 * number
    known = {
        "id": f"w12-f{number}",
        "kind": "facade",
        "block": "demo",
        "building": "w12",
        "geometry": LineString([(x, 6_671_700, 3), (x + 15, 6_671_700, 3)]),
        "street": "Fabianinkatu",
        "height_m": 19.2,
        "floors": np.int64(6),
        "window_to_wall": np.float32(0.25),
        "layout_score": float("nan"),
        "status": "done",
        "updated": datetime(2026, 11, 21, 12, 30, tzinfo=UTC),
        "code_version": "1",
        "config_digest": "ab",
    }
    return dict.fromkeys(ROW_KEYS) | known | changes


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "items.parquet"
    write_items(path, [row(10), row(9, status="failed", reason="too dark")], "EPSG:32635")
    items = gpd.read_parquet(path)
    assert list(items.columns) == [column.name for column in COLUMNS]
    assert list(items.id) == ["w12-f9", "w12-f10"]
    assert items.crs == "OGC:CRS84"
    assert items.to_crs("EPSG:32635").length.tolist() == pytest.approx([15.0, 15.0])
    assert not items.has_z.any()
    assert items[["xmin", "ymin", "xmax", "ymax"]].to_numpy() == pytest.approx(items.bounds.to_numpy())
    assert 24.9 < items.xmin[0] < items.xmax[0] < 25.0
    assert items.floors.tolist() == [6, 6]
    assert items.window_to_wall.tolist() == [0.25, 0.25]
    assert items.layout_score.isna().all(), "NaN is unknown"
    assert items.reason.tolist()[0] == "too dark"
    assert items.updated.tolist() == [datetime(2026, 11, 21, 12, 30, tzinfo=UTC)] * 2
    assert pq.read_table(path)["layout_score"].null_count == 2
    assert [p.name for p in tmp_path.iterdir()] == ["items.parquet"], "nothing is left behind"


VALUES: dict[str, st.SearchStrategy[Any]] = {
    "string": st.text(st.characters(exclude_categories=["Cs"]), max_size=12),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "double": st.floats(allow_nan=False),
    "timestamp[us, UTC]": st.datetimes(
        datetime(1900, 1, 1), datetime(2200, 1, 1), timezones=st.sampled_from([UTC, timezone(timedelta(hours=-9))])
    ),
}
SHAPES = ("id", "kind", "status", "reason", "geometry")


def value_of(column: ItemColumn) -> st.SearchStrategy[Any]:
    return VALUES[column.type] if column.required else st.none() | VALUES[column.type]


@st.composite
def rows(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Facades, and units set aside, with any values in the columns."""
    made = []
    for id in draw(st.lists(VALUES["string"], max_size=5, unique=True)):
        values = {c.name: draw(value_of(c)) for c in COLUMNS if c.name not in (*BBOX, *SHAPES)}
        kind = draw(st.sampled_from(["facade", "facade", "street"]))
        x, y = draw(st.floats(380_000, 390_000)), draw(st.floats(6_670_000, 6_680_000))
        foot = LineString([(x, y), (x + draw(st.floats(1, 90)), y + draw(st.floats(-90, 90)))])
        failed = kind != "facade" or draw(st.booleans())
        shape = {"kind": kind, "geometry": foot if kind == "facade" else None}
        made.append(
            {"id": id, **shape, "status": "failed" if failed else "done", "reason": "why" if failed else None} | values
        )
    return made


@settings(max_examples=25)
@given(rows())
def test_any_rows_come_back(tmp_path_factory: pytest.TempPathFactory, stated: list[dict[str, Any]]) -> None:
    path = tmp_path_factory.mktemp("items") / "items.parquet"
    write_items(path, stated, "EPSG:32635")
    found = pq.read_table(path).to_pylist()
    order = sorted(stated, key=lambda row: (row["kind"] != "facade", natural_sort_key(row["id"])))
    assert [row["id"] for row in found] == [row["id"] for row in order]
    for row, other in zip(order, found, strict=True):
        assert {name: other[name] for name in ROW_KEYS if name != "geometry"} == {
            name: value for name, value in row.items() if name != "geometry"
        }
        if row["geometry"] is None:
            assert other["geometry"] is None
            assert {other[name] for name in BBOX} == {None}
            continue
        foot = from_wkb(other["geometry"])
        assert foot.bounds == tuple(other[name] for name in BBOX)
        (back,) = gpd.GeoSeries([foot], crs="OGC:CRS84").to_crs("EPSG:32635")
        np.testing.assert_allclose(back.coords, row["geometry"].coords, atol=1e-5)


def test_same_rows_same_bytes_in_any_order(tmp_path: Path) -> None:
    write_items(tmp_path / "a", [row(1), row(2)], "EPSG:32635")
    write_items(tmp_path / "b", [row(2), row(1)], "EPSG:32635")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_no_facades_is_an_empty_catalogue(tmp_path: Path) -> None:
    write_items(tmp_path / "items.parquet", [], "EPSG:32635")
    assert gpd.read_parquet(tmp_path / "items.parquet").shape == (0, len(COLUMNS))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flors": 3}, "no such column flors"),
        ({"floors": "6"}, "floors is '6'; give int32"),
        ({"floors": 3.5}, "floors is 3.5; give int32"),
        ({"street": 5}, "street is 5; give string"),
        ({"block": None}, "column block is None"),
        (
            {"updated": datetime(2026, 11, 21)},
            "updated is datetime.datetime(2026, 11, 21, 0, 0); give timestamp[us, UTC]",
        ),
        ({"updated": "2026-11-21"}, "updated is '2026-11-21'; give timestamp[us, UTC]"),
        ({"geometry": None}, "geometry is no LineString"),
        ({"kind": "wall"}, "kind is 'wall'; give one of facade, block"),
        ({"kind": "building"}, "a building has a row only when it failed or is refused"),
        ({"geometry": LineString()}, "geometry is no LineString"),
        ({"status": "ok"}, "status is 'ok'; give one of done, failed, refused"),
        ({"status": "failed"}, "failed without a reason"),
    ],
)
def test_a_wrong_row_is_named_and_the_old_file_stays(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    path = tmp_path / "items.parquet"
    write_items(path, [row(1)], "EPSG:32635")
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"items.parquet: facade w12-f7: ") as error:
        write_items(path, [row(7, **changes)], "EPSG:32635")
    assert words in str(error.value)
    assert path.read_bytes() == before


def test_a_unit_set_aside_has_a_row_without_a_place(tmp_path: Path) -> None:
    path = tmp_path / "items.parquet"
    aside = {"building": None, "geometry": None, "status": "failed", "reason": "its footprint crosses itself"}
    rows = [row(3, id="w9", kind="building", **aside), row(2), row(4, id="w9", kind="photo", **aside)]
    write_items(path, rows, "EPSG:32635")
    items = gpd.read_parquet(path)
    assert list(items.kind) == ["facade", "building", "photo"], "facades first"
    assert items.geometry.isna().tolist() == [False, True, True]
    assert items.xmin.isna().tolist() == [False, True, True]
    assert items.crs == "OGC:CRS84"


def test_a_foot_line_with_a_corner_that_is_no_number_has_no_place(tmp_path: Path) -> None:
    path = tmp_path / "items.parquet"
    broken = [from_wkt("LINESTRING (nan 0, 385700 6671700)"), LineString([(1e300, 0), (385_700, 6_671_700)])]
    write_items(path, [row(1), *(row(i + 2, geometry=foot) for i, foot in enumerate(broken))], "EPSG:32635")
    items = gpd.read_parquet(path)
    assert items.geometry.isna().tolist() == [False, True, True]
    assert items.xmin.isna().tolist() == [False, True, True]


def test_missing_columns_and_twins_are_refused(tmp_path: Path) -> None:
    short = row(1)
    del short["floors"]
    with pytest.raises(InputError, match="column floors is missing"):
        write_items(tmp_path / "items.parquet", [short], "EPSG:32635")
    with pytest.raises(InputError, match="facade w12-f1 has two rows"):
        write_items(tmp_path / "items.parquet", [row(1), row(1)], "EPSG:32635")
