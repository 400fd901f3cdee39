"""What the viewer knows of a city's blocks without opening their stores: states, places, names, and what is found."""

from __future__ import annotations

import json
import time
import tracemalloc
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from catalogs.published.columns import ROW_KEYS
from catalogs.published.items import write_items
from catalogs.published.merged_items import merge_run_items
from catalogs.published.runs import PublishedRun
from flows.lock import is_locked, lock_folder
from flows.viewer import city_pages
from flows.viewer.city_pages import MAX_OPEN_RUNS, OpenBlocks
from tasks.city.city_log import BlockResult, write_block_result
from tasks.city.places import BlockPlace, main_streets, ring_around
from tasks.engine.commands import DEADLINE_EXIT_CODE
from tasks.viewing import city_view
from tasks.viewing.city_view import CityReader
from tasks.viewing.find import MAX_FOUND, find_in_city

CRS = "EPSG:32635"
EAST, NORTH = 385_000.0, 6_671_000.0


def place(column: int, streets: tuple[str, ...] = ("Main street",), crs: str = CRS) -> BlockPlace:
    x = EAST + 100 * column
    return BlockPlace(crs, ((x, NORTH), (x + 80, NORTH), (x + 80, NORTH + 50), (x, NORTH + 50)), streets)


def write_log(out: Path, places: dict[str, BlockPlace]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    values: dict[str, Any] = {
        "name": "town",
        "source": "s",
        "digests": dict.fromkeys(places, "d"),
        "set_aside": [],
        "told": {name: {"facades": 7} for name in places},
        "sources": {},
        "places": {name: one.to_json() for name, one in places.items()},
    }
    (out / "city.json").write_text(json.dumps(values))


def publish(out: Path, name: str, facades: list[tuple[str, str, str]] = (), snapshot: str = "S1") -> None:  # type: ignore[assignment]
    """A block's snapshot; facades: (id, building, street), along a line from the block's corner."""
    folder = out / "blocks" / name / "published" / snapshot
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text("{}")
    (out / "blocks" / name / "current").write_text(f"{snapshot}\n")
    x = EAST + 100 * int(name[1:])
    rows = []
    for number, (id_, building, street) in enumerate(facades):
        known = {"id": id_, "kind": "facade", "block": name, "building": building, "street": street, "status": "done"}
        line = shapely.LineString([(x + 10 * number, NORTH), (x + 10 * number + 8, NORTH)])
        known |= {"geometry": line, "updated": datetime.now(UTC), "code_version": "v", "config_digest": "d"}  # type: ignore[dict-item]
        rows.append(dict.fromkeys(ROW_KEYS) | known)
    write_items(folder / "items.parquet", rows, CRS)
    write_block_result(out, name, BlockResult(0, digest="d", version="v", snapshot=snapshot))


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CityReader:
    monkeypatch.setattr(city_view, "block_code_version", lambda: "v")
    monkeypatch.setattr(city_view, "MIN_REFRESH_S", 0.0)
    monkeypatch.setattr(city_view, "REFRESH_FACTOR", 0.0)
    return CityReader(tmp_path / "out", is_locked)


def test_blocks_have_states_places_and_names_of_streets(reader: CityReader) -> None:
    out = reader.out
    assert isinstance(out, Path)
    write_log(out, {f"b{n}": place(n) for n in range(7)} | {"b7": place(7, crs="EPSG:32634")})
    for name in ("b0", "b1", "b2"):
        publish(out, name)
    write_block_result(out, "b1", BlockResult(0, digest="d", version="earlier", snapshot="S1"))
    write_block_result(out, "b2", BlockResult(0, digest="another", version="v", snapshot="S1"))
    write_block_result(out, "b3", BlockResult(2, reason="b3.yaml: crs: is missing"))
    write_block_result(out, "b4", BlockResult(DEADLINE_EXIT_CODE, reason="its time was up"))
    reader.read()
    while not reader._code:  # computed after the first reading
        time.sleep(0.01)
    with lock_folder(out / "blocks" / "b5"):
        said = reader.describe()
    states = {block["name"]: block["state"] for block in said["blocks"]}
    assert states == {
        "b0": "done",
        "b1": "stale",
        "b2": "stale",
        "b3": "failed",
        "b4": "waiting",
        "b5": "running",
        "b6": "waiting",
        "b7": "waiting",
    }
    rows = {block["name"]: block for block in said["blocks"]}
    assert rows["b3"]["reason"] == "b3.yaml: crs: is missing"
    assert rows["b0"]["title"] == "Main street"
    assert said["origin"] == [EAST, NORTH]
    assert rows["b1"]["outline"][0] == [100.0, 0.0]
    assert rows["b7"]["outline"] == []
    assert len(said["notes"]) == 1, "of another CRS: told with what opens it"
    assert "streetloom view" in said["notes"][0]
    assert "\n" not in said["notes"][0]


def test_numbers_stay_where_the_city_is_cut_anew(reader: CityReader) -> None:
    assert isinstance(reader.out, Path)
    write_log(reader.out, {"b1": place(1), "b2": place(2)})
    before = {block.name: number for number, block in reader.read().blocks.items()}
    write_log(reader.out, {"b0": place(0), "b2": place(2)})
    after = {block.name: number for number, block in reader.read().blocks.items()}
    assert after["b2"] == before["b2"]
    assert after["b0"] not in before.values()
    assert reader.known_block(before["b1"]) is None


def test_what_is_found_has_a_box_also_where_a_block_was_published_since_the_catalogue(reader: CityReader) -> None:
    out = reader.out
    assert isinstance(out, Path)
    write_log(out, {f"b{n}": place(n) for n in range(3)})
    publish(out, "b0", [("h1-0", "h1", "Main street"), ("h2-0", "h2", "Main street")])
    publish(out, "b1", [("h3-0", "h3", "Main street"), ("old-0", "old", "Main street")])
    merge_run_items(out, [(PublishedRun(out / "blocks" / name, f"blocks/{name}"), "S1") for name in ("b0", "b1")])
    publish(out, "b1", [("h3-0", "h3", "Main street"), ("h4-0", "h4", "New street")], "S2")
    publish(out, "b2", [("h5-0", "h5", "New street")])

    def found(text: str) -> dict[tuple[str, str], dict[str, Any]]:
        return {(one["kind"], one["id"]): one for one in find_in_city(reader, text)["found"]}

    street = found("MAIN")["street", "Main street"]
    assert street["blocks"] == [0, 1]
    assert street["box"] == pytest.approx([0, 0, 108, 0], abs=4)
    assert found("new")["street", "New street"]["blocks"] == [1, 2]
    assert ("facade", "h4-0") in found("h4")
    assert found("old") == {}
    assert found("h5")["building", "h5"]["box"] == pytest.approx([200, 0, 208, 0], abs=4)
    assert found("b2")["block", "b2"]["box"] == [200.0, 0.0, 280.0, 50.0]
    assert found("  ") == {}
    assert len([one for one in found("h") if one[0] == "facade"]) <= MAX_FOUND


def test_a_city_of_a_thousand_blocks_is_read_quickly_without_a_store(
    reader: CityReader, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And in as much memory for each block as one of a hundred."""

    def opened(folder: object) -> None:
        raise AssertionError("a store was opened")

    monkeypatch.setattr(city_view, "RunReader", opened)
    out = reader.out
    assert isinstance(out, Path)
    write_log(out, {f"b{n}": place(n) for n in range(1000)})
    for n in range(0, 1000, 2):
        (folder := out / "blocks" / f"b{n}" / "published" / "S1").mkdir(parents=True)
        (folder / "summary.json").touch()
        (out / "blocks" / f"b{n}" / "current").write_text("S1\n")
        write_block_result(out, f"b{n}", BlockResult(0, digest="d", version="v", snapshot="S1"))
    tracemalloc.start()
    started = time.process_time()
    said = reader.describe()
    took = time.process_time() - started
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(said["blocks"]) == 1000
    assert sum(block["state"] == "done" for block in said["blocks"]) == 500
    assert took < 5
    assert held < 10_000_000
    assert len(json.dumps(said)) < 400_000


def test_few_runs_are_open_at_a_time(reader: CityReader, monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(reader.out, Path)
    write_log(reader.out, {f"b{n}": place(n) for n in range(20)})
    monkeypatch.setattr(city_pages, "run_routes", lambda reader, editor, redo: [])
    blocks = OpenBlocks(reader, None)
    for number in (*range(20), 17):
        assert blocks._open(number) is not None
    assert list(blocks._routers) == [16, 18, 19, 17]
    assert len(blocks._routers) == MAX_OPEN_RUNS
    assert blocks._open(20) is None


def test_an_outline_goes_around_with_few_corners() -> None:
    points = np.random.default_rng(1).uniform(0, 100, (500, 2))
    ring = shapely.Polygon(ring_around(points))
    assert ring.covers(shapely.MultiPoint(points))
    assert len(ring.exterior.coords) < 40
    assert ring_around(np.zeros((0, 2))) == ()
    assert main_streets(["b", "a", "b", "", "c", "a"]) == ("a", "b")
