"""Catalogues of many runs joined in one file: a query answers as before, whatever has happened since."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from catalogs.published import merged_items
from catalogs.published.file_list import write_file_list
from catalogs.published.items import write_items
from catalogs.published.merged_items import merge_run_items, read_merged_items_headers
from catalogs.published.runs import PublishedRun
from catalogs.query import execution
from catalogs.query.execution import query
from tests.catalogs.published.test_items import row


def publish(out: Path, name: str, snapshot: str, *numbers: int) -> tuple[PublishedRun[Path], str]:
    folder = out / "blocks" / name
    (folder / "published" / snapshot).mkdir(parents=True)
    write_items(folder / "published" / snapshot / "items.parquet", [row(n, block=name) for n in numbers], "EPSG:32635")
    (folder / "current").write_text(f"{snapshot}\n")
    return PublishedRun(folder, f"blocks/{name}"), snapshot


@pytest.fixture
def runs(tmp_path: Path) -> list[tuple[PublishedRun[Path], str]]:
    return [publish(tmp_path, f"x{n}", "A", 2 * n, 2 * n + 1) for n in range(4)]


def answer(out: Path) -> pd.DataFrame:
    return query(out).sort_values(["run", "id"], ignore_index=True)


def test_a_query_of_what_is_joined_is_one_of_the_runs(
    tmp_path: Path, runs: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = answer(tmp_path)
    merge_run_items(tmp_path, runs)
    monkeypatch.setattr(execution, "read_parquet_schema", lambda path: pytest.fail(f"{path} is read"))
    pd.testing.assert_frame_equal(answer(tmp_path), before)
    assert set(query(tmp_path, where="run = 'blocks/x2'").block) == {"x2"}
    west = before[before.id == "w12-f0"].iloc[0]
    assert set(query(tmp_path, bbox=(west.xmin, west.ymin, west.xmax, west.ymax)).id) >= {"w12-f0"}


def test_a_run_that_published_since_is_asked_itself(tmp_path: Path, runs: list) -> None:
    merge_run_items(tmp_path, runs)
    (tmp_path / "blocks" / "x1" / "published" / "B").mkdir()
    write_items(tmp_path / "blocks" / "x1" / "published" / "B" / "items.parquet", [row(77, block="x1")], "EPSG:32635")
    (tmp_path / "blocks" / "x1" / "current").write_text("B\n")
    publish(tmp_path, "x9", "A", 99)
    shutil.rmtree(tmp_path / "blocks" / "x3")
    found = query(tmp_path)
    assert set(found[found.run == "blocks/x1"].id) == {"w12-f77"}
    assert set(found.run) == {f"blocks/x{n}" for n in (0, 1, 2, 9)}
    assert len(found) == 2 + 1 + 2 + 1


def test_only_the_files_of_runs_that_changed_are_written(
    tmp_path: Path, runs: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(merged_items, "RUNS_PER_FILE", 2)
    merge_run_items(tmp_path, runs)
    files = {one.path.name: (one.path.stat().st_ino, sorted(one.runs)) for one in read_merged_items_headers(tmp_path)}
    assert [of for _, of in files.values()] == [["blocks/x0", "blocks/x1"], ["blocks/x2", "blocks/x3"]]
    (tmp_path / "blocks" / "x3" / "published" / "A").rename(tmp_path / "blocks" / "x3" / "published" / "B")
    (tmp_path / "blocks" / "x3" / "current").write_text("B\n")
    merge_run_items(tmp_path, [*runs[:3], (runs[3][0], "B"), publish(tmp_path, "x4", "A", 8)])
    after = {one.path.name: (one.path.stat().st_ino, sorted(one.runs)) for one in read_merged_items_headers(tmp_path)}
    assert len(after) == 3
    assert after["00000.parquet"] == files["00000.parquet"]
    assert after["00001.parquet"][0] != files["00001.parquet"][0]
    merge_run_items(tmp_path, [(runs[3][0], "B")])
    assert [sorted(one.runs) for one in read_merged_items_headers(tmp_path)] == [["blocks/x3"]]


def test_a_catalogue_that_does_not_fit_the_others_is_not_joined(tmp_path: Path, runs: list) -> None:
    path = tmp_path / "blocks" / "x1" / "published" / "A" / "items.parquet"
    table = pq.read_table(path).drop_columns("floors")
    pq.write_table(table.append_column("floors", pa.array(["five"] * len(table))), path)
    (tmp_path / "blocks" / "x2" / "published" / "A" / "items.parquet").write_bytes(b"cut")
    merge_run_items(tmp_path, runs)
    assert [sorted(one.runs) for one in read_merged_items_headers(tmp_path)] == [["blocks/x0", "blocks/x3"]]
    notes: list[str] = []
    assert set(query(tmp_path, on_left_out=notes.append).run) == {"blocks/x0", "blocks/x3"}
    assert len(notes) == 2


def test_a_damaged_file_is_none(tmp_path: Path, runs: list) -> None:
    merge_run_items(tmp_path, runs)
    (tmp_path / "items" / "00000.parquet").write_bytes(b"PAR1")
    assert len(query(tmp_path)) == 8
    merge_run_items(tmp_path, runs)
    assert len(read_merged_items_headers(tmp_path)[0].runs) == 4


def test_a_damaged_catalogue_is_not_joined_and_named(tmp_path: Path, runs: list) -> None:
    published = tmp_path / "blocks" / "x1" / "published" / "A"
    write_file_list(published, None)
    whole = (published / "items.parquet").read_bytes()
    (published / "items.parquet").write_bytes(whole[:99] + bytes([whole[99] ^ 1]) + whole[100:])
    merge_run_items(tmp_path, runs)
    assert [sorted(one.runs) for one in read_merged_items_headers(tmp_path)] == [[f"blocks/x{n}" for n in (0, 2, 3)]]
    notes: list[str] = []
    assert len(query(tmp_path, on_left_out=notes.append)) == 6
    assert len(notes) == 1
    assert "x1/published/A/items.parquet is not as it was written" in notes[0]
