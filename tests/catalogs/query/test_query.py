"""Queries: only what is published, only conditions over its columns."""

from __future__ import annotations

import json
import shutil
import time
from datetime import UTC, datetime
from pathlib import Path

import geopandas as gpd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from click.testing import CliRunner
from shapely import LineString

import catalogs
from catalogs.published.columns import COLUMNS, ROW_KEYS
from catalogs.published.items import write_items
from catalogs.query.execution import query
from catalogs.query.formats import format_items
from catalogs.query.where import combine_conditions, parse_since
from facade_core.core.errors import InputError
from flows.cli.commands import command_line


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
            "updated": datetime(2026, 11, 1 + index, 12, 30, tzinfo=UTC),
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
        ("TRUE", range(12)),
        ("NULL", ()),
        ("NOT contains(street, 'katu') AND (floors > 5) = TRUE", (11,)),
        ("coalesce(windows > 3, FALSE) AND id NOT IN ('f0', 'f1')", (2, 3, 4, *range(6, 12))),
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
        ('status = "done"', "unknown column done; if it is text, write 'done', in single quotes"),
        ("zzz > 3", "'zzz', in single quotes; `streetloom query --help` lists all columns"),
        ("hidden_share > 0.1", "`streetloom query --help` lists all columns"),
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
        ("street = '\ud800'", "holds half a character"),
        ("read_text('/etc/passwd') = ''", "function read_text is not allowed"),
        ("getenv('HOME') = ''", "function getenv is not allowed"),
        ("floors >== 5", "operator >== is not allowed here; allowed are ="),
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
        ("floors", "floors alone is no condition; compare it"),
        ("NOT floors", "floors alone is no condition"),
        ("floors > 3 AND street", "street alone is no condition"),
        ("coalesce(floors, TRUE)", "floors alone is no condition"),
        ("1", "a value alone is no condition"),
        ("'BOOLEAN'", "a value alone is no condition"),
        ("floors + 1", "what + gives is no condition"),
        ("length(street)", "what length gives is no condition"),
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
    with pytest.raises(InputError, match=r"^--bbox 60 24.9 61 25: latitudes come first there: write 24.9 60 25 61$"):
        query(out, bbox=(60, 24.9, 61, 25))
    assert query(out, bbox=(60, 24.9, 61, 25), where="floors = 50").empty
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


def test_a_table_shows_the_columns_that_were_asked_about(out: Path) -> None:
    where = "quality IS NULL AND Floors = 5 AND street <> 'photo' AND photo IS NULL AND kind = 'facade'"
    head = format_items(query(out, where=where), where=where).splitlines()[0].split()
    assert head[-3:] == ["quality", "photo", "status"]
    assert len(head) == len(set(head))
    assert "geometry" not in format_items(query(out), where="geometry IS NOT NULL").splitlines()[0]


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


def test_since(out: Path) -> None:
    """Facade i was made on the day 1 + i of November at 12:30 UTC."""
    for since, ids in (
        ("2026-11-11", (10, 11)),
        ("2026-11-11T12:30", (10, 11)),
        ("2026-11-11T12:30:01Z", (11,)),
        ("2026-11-11T14:30+02:00", (10, 11)),
        ("2026-11-11T14:31+02:00", (11,)),
        ("20000w", range(12)),
        ("0m", ()),
    ):
        assert list(query(out, since=since).id) == [f"f{i}" for i in ids], since
    assert list(query(out, since="2026-11-05", where="floors = 6", bbox=(0, 0, 90, 90)).id) == ["f7", "f11"]
    assert list(query(out, where="updated < '2026-11-02 12:31' AND updated >= '2026-11-02'").id) == ["f1"]
    now = datetime(2026, 11, 21, 6, tzinfo=UTC)
    assert parse_since("36h", now) == datetime(2026, 11, 19, 18, tzinfo=UTC)
    assert parse_since("7d", now) == datetime(2026, 11, 14, 6, tzinfo=UTC)


@pytest.mark.parametrize(
    "since", ["", "yesterday", "7", "-7d", "7y", "2026-13-01", "99999999999w", "0001-01-01T00:00+14:00"]
)
def test_a_wrong_time_is_refused_in_one_line(out: Path, since: str) -> None:
    with pytest.raises(InputError, match=r"^--since .*: not a time; give a date") as error:
        query(out, since=since)
    assert "\n" not in str(error.value)


def test_times_are_in_utc_everywhere(out: Path) -> None:
    assert str(query(out).updated.dtype) == "datetime64[us, UTC]"
    assert json.loads(format_items(query(out, where="id = 'f3'"), "json"))[0]["updated"] == "2026-11-04T12:30:00Z"
    (feature,) = json.loads(format_items(query(out, where="id = 'f3'"), "geojson"))["features"]
    assert feature["properties"]["updated"] == "2026-11-04T12:30:00Z"


@pytest.fixture
def runs(out: Path, tmp_path: Path) -> Path:
    """Two runs of one block, an older one without `updated` and with a column of its own, one idle, two broken."""
    for name in ("night=1", "city/night [2]"):
        shutil.copytree(out, tmp_path / name)
    table = pq.read_table(out / "published" / "OLD" / "items.parquet").drop_columns(["updated", "floors"])
    table = table.append_column("floors", pa.array([5], pa.int64())).append_column("era", pa.array(["1900"]))
    old = tmp_path / "old"
    (old / "published" / "S").mkdir(parents=True)
    pq.write_table(table, old / "published" / "S" / "items.parquet")
    (old / "current").write_text("S")
    (tmp_path / "idle" / "store").mkdir(parents=True)
    for name, current in (("gone", "NOWHERE"), ("odd", "../../etc")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "current").write_text(current)
    (tmp_path / "a" / "b" / "c").mkdir(parents=True)
    shutil.copy(out / "current", tmp_path / "a" / "b" / "c")
    shutil.copytree(out, tmp_path / "old" / "inner")
    (tmp_path / "file.txt").write_text("")
    return tmp_path


def test_runs_are_united_by_the_names_of_columns(runs: Path) -> None:
    notes: list[str] = []
    found = query(runs, on_left_out=notes.append)
    assert found.run.value_counts().to_dict() == {"night=1": 12, "city/night [2]": 12, "old": 1}
    assert list(found.columns)[: len(COLUMNS) + 1] == [*(column.name for column in COLUMNS), "run"]
    assert found[found.run == "old"][["floors", "era"]].values.tolist() == [[5, "1900"]]
    assert found[found.run == "old"].updated.isna().all()
    assert found[found.run != "old"].era.isna().all()
    assert "night" not in found, "a folder's name is no column"
    assert sorted(note.split()[0] for note in notes) == ["gone", "idle", "odd"]
    assert all("\n" not in note and " is left out: " in note for note in notes)


def test_run_is_a_column_to_ask_for(runs: Path, out: Path) -> None:
    assert set(query(runs, where="run = 'old' OR (run LIKE 'city/%' AND id = 'f3')").run) == {"old", "city/night [2]"}
    assert len(query(runs, since="2026-11-12")) == 2, "what has no time was not made since"
    assert len(query(runs, bbox=(0, 0, 90, 90), where="id = 'f0'")) == 3
    assert set(query(out).run) == {out.name}
    assert set(query(runs / "old").run) == {"old"}, "a run's own folder is not searched"
    lines = format_items(query(runs, where="id = 'f0'")).splitlines()
    assert [line.split()[0] for line in (lines[0], *lines[2:5])] == ["run", "city/night", "night=1", "old"]
    assert "run" not in format_items(query(out)).splitlines()[0].split()


def test_a_run_whose_columns_differ_in_type_is_left_out(runs: Path) -> None:
    path = runs / "old" / "published" / "S" / "items.parquet"
    table = pq.read_table(path).drop_columns("floors")
    pq.write_table(table.append_column("floors", pa.array(["five"])), path)
    notes: list[str] = []
    assert set(query(runs, on_left_out=notes.append).run) == {"night=1", "city/night [2]"}
    assert any(note.startswith("old is left out: ") and "differ in type" in note for note in notes)
    path.write_bytes(b"PAR1 no")
    query(runs, on_left_out=notes.append)
    assert "cannot be read as Parquet" in notes[-1]


def test_no_run_that_can_be_read(tmp_path: Path) -> None:
    (tmp_path / "a" / "store").mkdir(parents=True)
    with pytest.raises(InputError, match="nothing is published there"):
        query(tmp_path)
    for name in ("b", "c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "current").write_text("GONE")
    with pytest.raises(InputError, match=r"no run can be read; c is left out: .*items.parquet is missing"):
        query(tmp_path)


def test_the_command(runs: Path) -> None:
    asked = ["query", str(runs), "--since", "2026-11-12", "--where", "floors = 6", "--format", "json"]
    done = CliRunner().invoke(command_line, asked)
    assert done.exit_code == 0
    assert [(row["run"], row["id"]) for row in json.loads(done.stdout)] == [
        ("city/night [2]", "f11"),
        ("night=1", "f11"),
    ]
    assert "streetloom: idle is left out: nothing is published there yet" in done.stderr.splitlines()
    assert CliRunner().invoke(command_line, ["query", str(runs), "--since", "soon"]).exit_code == 2


@pytest.mark.parametrize("box", [("24", "60", "25"), ("24", "60", "25", "--format", "json"), ("a", "b", "c", "d")])
def test_a_box_of_other_than_four_numbers_is_refused_with_an_example(out: Path, box: tuple[str, ...]) -> None:
    done = CliRunner().invoke(command_line, ["query", str(out), "--bbox", *box])
    assert done.exit_code == 2
    assert done.stderr.splitlines() == [
        "streetloom: --bbox: give four numbers, WEST SOUTH EAST NORTH in degrees, such as --bbox 24.94 60.16 24.95 60.17"
    ]


def test_the_command_writes_geoparquet(out: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(command_line, ["query", str(out), "--where", "floors = 5", "--format", "parquet"])
    assert done.exit_code == 0
    (tmp_path / "found.parquet").write_bytes(done.stdout_bytes)
    frame = gpd.read_parquet(tmp_path / "found.parquet")
    assert frame.id.tolist() == ["f2", "f6", "f10"]
    assert frame.to_crs("EPSG:32635").length.tolist() == pytest.approx([15.0] * 3, abs=0.03)
    assert frame.floors.tolist() == [5, 5, 5]


def test_python_names_the_argument_that_is_wrong(out: Path) -> None:
    catalogue = catalogs.open(out)
    for arguments, words in (
        ({"where": "florrs > 1"}, "where 'florrs > 1': unknown column florrs"),
        ({"where": " "}, "where is empty"),
        ({"bbox": (1, 2, 3)}, "bbox 1 2 3: give WEST SOUTH EAST NORTH in degrees"),
        ({"since": "soon"}, "since 'soon': not a time"),
    ):
        with pytest.raises(InputError) as refused:
            catalogue.search(**arguments)
        assert str(refused.value).startswith(words)


def test_a_time_without_a_zone_is_in_utc_wherever_the_machine_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "America/New_York")
    time.tzset()
    try:
        assert parse_since("2026-11-11T12:30") == datetime(2026, 11, 11, 12, 30, tzinfo=UTC)
    finally:
        monkeypatch.undo()
        time.tzset()


def test_of_several_conditions_each_is_one_by_itself(out: Path) -> None:
    assert combine_conditions([]) is None
    both = combine_conditions(["floors >= 1 -- of any", "id = 'f1' OR id = 'f2'"])
    assert list(query(out, where=both).id) == ["f1", "f2"]
    for broken, words in (
        ("id = 'f1') OR (TRUE", "syntax error"),
        ("", "--where is empty"),
        ("TRUE LIMIT 1", "more than"),
    ):
        with pytest.raises(InputError, match=words):
            combine_conditions(["floors >= 1", broken])


def test_a_box_in_metres_is_refused(out: Path) -> None:
    done = CliRunner().invoke(command_line, ["query", str(out), "--bbox", "385000", "6671000", "385100", "6671100"])
    assert done.exit_code == 2
    assert done.stderr.splitlines() == [
        "streetloom: --bbox: 385000 6671000 385100 6671100; longitude and latitude in degrees are needed"
    ]
