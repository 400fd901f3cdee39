"""Runs in a bucket: copied there, asked and opened, over real HTTP against a server on loopback."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import icechunk
import numpy as np
import pyarrow.parquet as pq
import pytest
import xarray as xr
import zarr
from click.testing import CliRunner
from pyarrow.dataset import dataset, field

import catalogs
from catalogs.published import object_store
from catalogs.published.s3 import S3Path, folder_at
from catalogs.published.s3_copy import copy_run_to_bucket, put_object
from catalogs.query.execution import _filtered_dataset, query
from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tests.bucket import served
from tests.catalogs.stac.test_stac import aside, publish, row

# Between the third and the fourth facade of a run.
WEST = 24.94128


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    with served("city") as address:
        yield address


def write_store(out: Path, facade: str) -> str:
    """A store with one facade of 3 x 4 texels on a page of 8 x 8; returns its snapshot."""
    repository = icechunk.Repository.create(icechunk.local_filesystem_storage(str(out / "store")))
    session = repository.writable_session("main")
    root = zarr.group(session.store)
    for name, kind, trailing in (
        ("atlas/colour", "u1", (3,)),
        ("atlas/provenance", "u1", ()),
        ("atlas/seed", "u1", (3,)),
        ("facade_maps/evidence", "u1", (3,)),
        ("facade_maps/labels", "u1", ()),
        ("facade_maps/occluded", "?", ()),
        ("facade_maps/confidence", "u1", ()),
    ):
        array = root.create_array(name, shape=(1, 8, 8, *trailing), dtype=kind, chunks=(1, 8, 8, *trailing))
        array.attrs["long_name"] = name
        array[:] = np.arange(64 * int(np.prod(trailing, dtype=int))).reshape(array.shape) % 250
    root["atlas"].attrs.update(crs="EPSG:32635", texels_per_metre=10.0)
    journal = root.create_array("journal/facades", shape=(1,), dtype=str, chunks=(1,))
    journal[0] = json.dumps({"elements": [["window", 0, 0, 1, 1, 0.9]]})
    tables = {
        "facades": xr.Dataset({"id": ("facade", np.array([facade])), "chart": ("facade", [0])}),
        "charts": xr.Dataset(
            {name: ("chart", [value]) for name, value in {"page": 0, "x": 2, "y": 1, "width": 4, "height": 3}.items()}
            | {name: (("chart", "xyz"), np.eye(3)[:1]) for name in ("origin", "axis_u", "axis_v")}
        ),
    }
    for name, table in tables.items():
        table.to_zarr(session.store, group=name, consolidated=False, zarr_format=3)
    return session.commit("all")


def make_run(out: Path, count: int, **changes: Any) -> Path:
    """A run that published `count` facades, the first of which is in its store."""
    out.mkdir(parents=True)
    snapshot = write_store(out, "w0-f0")
    rows = [row(f"w{number}-f0", number, **changes) for number in range(count)]
    publish(out, [*rows, aside("w99")], snapshot)
    return out


@pytest.fixture(scope="module")
def runs(bucket: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs, copied into the bucket by the command, beside a folder that is none."""
    folder = tmp_path_factory.mktemp("runs")
    make_run(folder / "a", 5)
    make_run(folder / "north" / "b", 2, floors=9)
    done = CliRunner().invoke(command_line, ["catalog", str(folder), "--to", f"{bucket}/runs"])
    assert done.exit_code == 0, done.output
    assert done.stdout.split() == [f"{bucket}/runs/catalog.json"]
    S3Path("city/runs/idle/store/config.yaml").touch()
    return folder


def test_a_folder_in_a_bucket_answers_as_the_folder_does(bucket: str, runs: Path) -> None:
    for asked in (
        {},
        {"where": "floors >= 9 AND kind = 'facade'"},
        {"where": "run = 'a' OR id = 'w1-f0'", "since": "2026-11-02"},
        {"bbox": (WEST, 60.0, 90, 61.0)},
    ):
        notes: list[str] = []
        there, here = query(f"{bucket}/runs", on_left_out=notes.append, **asked), query(runs, **asked)
        assert there.equals(here), asked
        assert notes == ["idle is left out: nothing is published there yet"]
    assert len(query(f"{bucket}/runs")) == 9
    assert set(query(f"{bucket}/runs/north/b/").run) == {"b"}
    assert set(query(f"{bucket}/runs", bbox=(WEST, 60.0, 90, 61.0)).id) == {"w3-f0", "w4-f0"}
    assert query(f"{bucket}/runs/a", bbox=(0, 0, 1, 1)).empty


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("read_text('/etc/passwd') = ''", "function read_text is not allowed"),
        ("EXISTS (FROM run_0)", "subquery is not allowed"),
        ("run_0.floors > 1", "unknown column run_0.floors"),
        ("floors", "floors alone is no condition"),
        ("TRUE; DROP VIEW items", "more than a condition"),
    ],
)
def test_conditions_are_as_safe_there(bucket: str, runs: Path, where: str, words: str) -> None:
    with pytest.raises(InputError) as refused:
        query(f"{bucket}/runs", where=where)
    assert words in str(refused.value) or "not a condition" in str(refused.value)


def test_row_groups_outside_the_box_are_not_fetched(bucket: str, tmp_path: Path) -> None:
    rows = [row(f"w{i}-f0", i % 5) | {"geometry": row("x", i % 5)["geometry"]} for i in range(5)]
    table = pq.read_table(publish(tmp_path, rows) / "items.parquet").sort_by("xmin")
    path = S3Path("city/grouped.parquet")
    with BytesIO() as stream:
        pq.write_table(table, stream, row_group_size=1)
        object_store.upload_object(path.path, stream.getvalue())
    found = _filtered_dataset(path, table.schema, [WEST, 0, 90, 90], datetime(2026, 11, 5, tzinfo=UTC))
    assert found.to_table()["id"].to_pylist() == ["w4-f0"]
    (fragment,) = dataset(path.path, filesystem=object_store.arrow_filesystem(), format="parquet").get_fragments()
    kept = fragment.split_by_row_group(field("xmax") >= WEST)
    assert [group.row_groups[0].id for group in kept] == [3, 4], "the file's statistics tell them apart"


def test_python_opens_a_facade_from_a_bucket(bucket: str, runs: Path) -> None:
    catalogue = catalogs.open(f"{bucket}/runs")
    assert len(catalogue.search("kind = 'facade'")) == 7
    there = catalogue.facade("w0-f0", run="north/b")
    here = catalogs.open(runs).facade("w0-f0", run="north/b")
    xr.testing.assert_identical(there, here)
    assert there.sizes == {"y": 3, "x": 4, "band": 3}
    assert int(there.provenance[0, 0]) == 1 * 8 + 2
    with pytest.raises(InputError, match=f"{bucket}/runs: facade w0-f0 is in the runs a, north/b; name one with run="):
        catalogue.facade("w0-f0")


def test_a_facade_is_kept_as_zarr_and_as_netcdf(tmp_path: Path) -> None:
    facade = catalogs.open(make_run(tmp_path / "out", 1)).facade("w0-f0")
    facade.to_zarr(tmp_path / "facade.zarr", zarr_format=3)
    xr.testing.assert_identical(xr.open_zarr(tmp_path / "facade.zarr", consolidated=False).load(), facade)
    facade.astype("int16").to_netcdf(tmp_path / "facade.nc", engine="scipy")
    kept = xr.load_dataset(tmp_path / "facade.nc", engine="scipy")
    xr.testing.assert_equal(kept.astype("int64"), facade.astype("int64"))
    assert kept.attrs["elements"] == facade.attrs["elements"]
    assert kept.colour.attrs["long_name"] == "atlas/colour"


def test_the_catalogue_in_the_bucket_is_whole(bucket: str, runs: Path) -> None:
    """Every link of every STAC file leads to an object."""
    waiting, seen = ["city/runs/catalog.json"], set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        value = json.loads(S3Path(path).read_bytes())
        for link in value["links"]:
            parts = [*path.split("/")[:-1], *link["href"].split("/")]
            resolved: list[str] = []
            for part in parts:
                if part == "..":
                    resolved.pop()
                elif part != ".":
                    resolved.append(part)
            waiting.append("/".join(resolved))
    assert sum("/facades/w" in path for path in seen) == 7


def test_what_is_there_is_not_sent_again_and_the_pointer_comes_last(bucket: str, tmp_path: Path) -> None:
    out, target = make_run(tmp_path / "out", 2), S3Path("city/again")
    first = copy_run_to_bucket(out, target)
    order: list[str] = []

    def put(place: S3Path, name: str, data: bytes) -> None:
        order.append(name)
        put_object(place, name, data)

    assert copy_run_to_bucket(out, target, put=put) < first
    assert not [name for name in order if name.endswith((".parquet", ".webp")) or "/chunks/" in name]
    order.clear()
    publish(out, [row("w0-f0"), row("w1-f0", 1)], "NEXT", predecessor=(out / "current").read_text().strip())
    copy_run_to_bucket(out, target, put=put)
    assert order[-2:] == ["current", "catalog.json"]
    last_data = max(i for i, name in enumerate(order) if name.startswith("published/"))
    assert last_data < min(i for i, name in enumerate(order) if name.startswith("store/refs"))
    assert len(query(str(target), where="kind = 'facade'")) == 2


def test_a_copy_that_breaks_off_leaves_the_old_snapshot(bucket: str, tmp_path: Path) -> None:
    out, target = make_run(tmp_path / "out", 2), S3Path("city/broken")
    copy_run_to_bucket(out, target)
    publish(out, [row("w0-f0")], "NEXT")

    def put(place: S3Path, name: str, data: bytes) -> None:
        if name.endswith("items.parquet"):
            raise InputError("the line is cut")
        put_object(place, name, data)

    with pytest.raises(InputError, match="the line is cut"):
        copy_run_to_bucket(out, target, put=put)
    assert len(query(str(target), where="kind = 'facade'")) == 2


def test_what_is_not_there_is_one_line(bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        InputError, match=r"s3://city/none: no such folder; `streetloom run BLOCK.yaml --out s3://city/none` makes it"
    ):
        query(f"{bucket}/none")
    with pytest.raises(InputError, match="no such folder"):
        query("s3://nobody-has-this/runs")
    with pytest.raises(InputError, match="names no bucket"):
        folder_at("s3://")
    out = make_run(tmp_path / "out", 1)
    done = CliRunner().invoke(command_line, ["catalog", str(out), "--to", "s3://nobody-has-this/x"])
    assert done.exit_code == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "there is no such bucket" in done.stderr
    assert CliRunner().invoke(command_line, ["catalog", str(out), "--to", str(tmp_path)]).exit_code == 2


def test_the_command_asks_a_bucket(bucket: str, runs: Path) -> None:
    done = CliRunner().invoke(command_line, ["query", f"{bucket}/runs", "--where", "floors = 9", "--format", "json"])
    assert done.exit_code == 0
    assert {found["run"] for found in json.loads(done.stdout)} == {"north/b"}
    assert "streetloom: idle is left out" in done.stderr
