"""Queries: only what is published, only conditions over its columns."""

from __future__ import annotations

import json
from pathlib import Path

import geopandas as gpd
import pytest
import shapely
from shapely import LineString

from catalogs.items import ROW_KEYS, write_items
from catalogs.query import format_items, query
from facade_core.errors import InputError


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve facades in a row, 20 m apart; the sixth failed; a second snapshot that is not current."""
    folder = tmp_path_factory.mktemp("out")
    rows = []
    for index in range(12):
        x = 385_700 + 20 * index
        known = {
            "id": f"f{index}",
            "kind": "facade",
            "block": "demo",
            "building": f"w{index // 4}",
            "geometry": LineString([(x, 6_671_700), (x + 15, 6_671_700)]),
            "street": "Fabianinkatu" if index < 8 else "Itäinen Teatterikuja",
            "height_m": 12.0 + index,
            "floors": 3 + index % 4,
            "windows": None if index == 5 else 20,
            "layout_score": float("-inf") if index == 0 else -1.0,
            "status": "failed" if index == 5 else "done",
            "reason": "too dark" if index == 5 else None,
            "code_version": "1",
            "config_digest": "ab",
        }
        rows.append(dict.fromkeys(ROW_KEYS) | known)
    for snapshot, shown in (("NEW", rows), ("OLD", rows[:1])):
        (folder / "published" / snapshot).mkdir(parents=True)
        write_items(folder / "published" / snapshot / "items.parquet", shown, "EPSG:32635")
    (folder / "current").write_text("NEW\n")
    return folder


@pytest.mark.parametrize(
    ("where", "ids"),
    [
        (None, range(12)),
        ("floors >= 6", (3, 7, 11)),
        ("Floors = 6 AND street ILIKE 'fabian%'", (3, 7)),
        ("floors = 6 -- the tallest", (3, 7, 11)),
        ("status = 'failed' OR windows IS NULL", (5,)),
        ("NOT (floors BETWEEN 4 AND 6)", (0, 4, 8)),
        ("building IN ('w0') AND height_m * 2 - 1 > 26", (2, 3)),
        ("street LIKE 'It_inen%' AND coalesce(windows, 0) > 0 AND length(id) = 3", (10, 11)),
        ("columns IS NOT NULL", ()),
        ("id = 'f1'' OR ''1''=''1'", ()),
        ("lower(upper(id)) = 'f1';", (1,)),
    ],
)
def test_conditions(out: Path, where: str | None, ids: range | tuple[int, ...]) -> None:
    assert list(query(out, where=where).id) == [f"f{index}" for index in ids]


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("florrs > 3", "unknown column florrs; did you mean floors?"),
        ('status = "done"', "unknown column done; text goes in 'single quotes'"),
        ("floors = 'six'", "Could not convert string 'six' to INT32"),
        ("street > 5", "Cannot compare"),
        ("street = 'x", "unterminated"),
        ("", "--where is empty"),
        ("x" * 3000, "at most 2000"),
        ("floors > 3; DROP TABLE items", "not a condition"),
        ("floors > 3; SELECT 1", "more than a condition"),
        ("floors > 3) OR (TRUE", "syntax error"),
        ("floors IN (SELECT 1)", "subquery is not allowed"),
        ("EXISTS (FROM items)", "subquery is not allowed"),
        ("TRUE UNION SELECT * FROM items", "more than a condition"),
        ("TRUE ORDER BY id", "more than a condition"),
        ("TRUE LIMIT 1", "more than a condition"),
        ("TRUE GROUP BY ALL", "more than a condition"),
        ("TRUE HAVING TRUE", "more than a condition"),
        ("TRUE QUALIFY TRUE", "more than a condition"),
        ("floors = $1", "more than a condition"),
        ("read_text('/etc/passwd') = ''", "function read_text is not allowed"),
        ("getenv('HOME') = ''", "function getenv is not allowed"),
        ("lower(read_blob('/etc/passwd')) = ''", "function read_blob is not allowed"),
        ("main.lower(street) = 'x'", "function lower is not allowed"),
        ("lower(DISTINCT street) = 'x'", "not allowed"),
        ("repeat('x', 1000000000) = ''", "function repeat is not allowed"),
        ("count(*) > 1", "not allowed"),
        ("row_number() OVER () > 1", "not allowed"),
        ("floors::TEXT = '3'", "operator cast is not allowed"),
        ("COLUMNS(*) > 4", "star is not allowed"),
        ("items.floors > 3", "unknown column items.floors"),
        ("rowid = 1", "unknown column rowid"),
        ("#1 = 2", "not allowed"),
        ("CASE WHEN TRUE THEN TRUE END", "not allowed"),
        ("len([x FOR x IN range(9)]) > 1", "not allowed"),
        ("NOT " * 450 + "florrs", "unknown column florrs"),
    ],
)
def test_anything_but_a_condition_is_refused_in_one_line(out: Path, where: str, words: str) -> None:
    with pytest.raises(InputError, match=r"^--where") as error:
        query(out, where=where)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_box(out: Path) -> None:
    everything = query(out)
    third = everything.iloc[3]
    middle = (third.xmin + third.xmax) / 2
    assert list(query(out, bbox=(middle, 60, middle + 1e-6, 61)).id) == ["f3"], "touching is enough"
    assert list(query(out, bbox=(middle, 60, 25, 61), where="floors = 6").id) == ["f3", "f7", "f11"]
    assert query(out, bbox=(0, 0, 1, 1)).empty
    for box in ((1, 2, 3), (5, 1, 2, 3), (float("nan"), 1, 2, 3)):
        with pytest.raises(InputError, match=r"--bbox .*: give WEST SOUTH EAST NORTH"):
            query(out, bbox=box)


def test_table(out: Path) -> None:
    lines = format_items(query(out, where="floors = 5")).splitlines()
    assert lines[0].split()[:4] == ["id", "street", "height_m", "width_m"]
    assert lines[2].split() == ["f2", "Fabianinkatu", "14.00", "-", "5", "20", "-", "-", "-", "-", "-", "done"]
    assert lines[-1] == "3 facades"
    assert len({line.index("14.00") + 5 for line in lines if "14.00" in line}) == 1
    assert format_items(query(out, where="floors = 50")) == "no facade matches"


def test_json(out: Path) -> None:
    (found,) = json.loads(format_items(query(out, where="id = 'f5'"), "json"))
    assert found["floors"] == 4
    assert found["windows"] is None
    assert found["reason"] == "too dark"
    assert "geometry" not in found
    assert json.loads(format_items(query(out, where="id = 'f0'"), "json"))[0]["layout_score"] is None, "no -Infinity"
    assert json.loads(format_items(query(out, where="floors = 50"), "json")) == []


def test_geojson(out: Path, tmp_path: Path) -> None:
    path = tmp_path / "facades.geojson"
    path.write_text(format_items(query(out, where="floors = 5"), "geojson"), encoding="utf-8")
    collection = json.loads(path.read_text(encoding="utf-8"))
    assert collection["type"] == "FeatureCollection"
    assert [f["id"] for f in collection["features"]] == ["f2", "f6", "f10"]
    for feature in collection["features"]:
        assert feature["bbox"] == list(shapely.geometry.shape(feature["geometry"]).bounds)
    frame = gpd.read_file(path)
    assert frame.street.tolist()[2] == "Itäinen Teatterikuja"
    assert frame.to_crs("EPSG:32635").length.tolist() == pytest.approx([15.0] * 3, abs=0.03)
    assert json.loads(format_items(query(out, where="floors = 50"), "geojson"))["features"] == []
    with pytest.raises(InputError, match="choose table, json, geojson"):
        format_items(query(out), "csv")


def test_only_current_is_read(out: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder; `streetloom run"):
        query(tmp_path / "nowhere")
    with pytest.raises(InputError, match="nothing is published there; `streetloom run"):
        query(tmp_path)
    for content, words in (("../../etc", "does not hold a snapshot id"), ("GONE", "items.parquet is missing")):
        (tmp_path / "current").write_text(content)
        with pytest.raises(InputError, match=words):
            query(tmp_path)
    folder = tmp_path / "published" / "GONE"
    folder.mkdir(parents=True)
    (folder / "items.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(InputError, match="cannot be read as Parquet"):
        query(tmp_path)
    (tmp_path / "current").write_text("OLD")
    (tmp_path / "published" / "OLD").symlink_to(out / "published" / "OLD")
    assert list(query(tmp_path).id) == ["f0"]
