"""A city of two blocks in a bucket is that of a folder: with its blocks in this process, which starts none for each, and as it
is typed, stopped by the clock, killed, and gone on with on a cluster."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from click.testing import CliRunner

import facade_core.export.pictures.views
from catalogs.published import object_store
from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.merged_items import read_merged_items_headers
from catalogs.published.s3 import S3Path, folder_at
from catalogs.query.execution import query
from facade_core.core.errors import InputError
from flows import city as flows_of_cities
from flows.block import texture_block
from flows.city import texture_city
from flows.city_options import CityOptions
from flows.cli.commands import command_line
from flows.lock import is_locked
from tasks.city import block_process
from tasks.engine.commands import DEADLINE_EXIT_CODE, CommandResult, run_command
from tasks.export.formats import export_run
from tasks.viewing.city_view import CityReader
from tasks.viewing.find import find_in_city
from tasks.viewing.run_view import RunReader
from tests.bucket import KEY, SECRET, served
from tests.pipeline.runs import ROOT, environment, working_in
from tests.pipeline.stages import VIEW_SIZE, write_block
from tests.pipeline.test_bucket import done
from tests.pipeline.test_city import HOUSES, STREETS
from tests.pipeline.test_cluster import finish, machines, wait_until

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]

# What runs a block as it is typed.
TYPED = run_command


def run_in_process(arguments: Sequence[str], ends: float | None, errors: Path) -> CommandResult:
    """What the command line does with some arguments, here."""
    if arguments[0] == "run":
        try:
            summary = texture_block(Path(arguments[1]), folder_at(arguments[3]), workers=1)
        except InputError as error:
            return CommandResult(2, str(error), "", 0.0)
        return CommandResult(0, "", json.dumps(summary, default=str), 0.0)
    export_run(folder_at(arguments[1]), arguments[3])
    return CommandResult(0, "", "", 0.0)


def textured(file: Path, out: Folder, **asked: Any) -> dict[str, Any]:
    return texture_city(file, out, CityOptions(workers=1, at_once=1, **asked))


@pytest.fixture(scope="module")
def cities(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, S3Path, Path, dict[str, Any]]]:
    base = tmp_path_factory.mktemp("city")
    file = write_block(base, buildings=HOUSES, streets=STREETS)
    keys = yaml.safe_load(file.read_text()) | {"name": "town", "cut": {"metres": 70}}
    file.write_text(yaml.safe_dump(keys))
    with served("city") as address, pytest.MonkeyPatch.context() as patch:
        patch.setattr(facade_core.export.pictures.views, "VIEW_SIZE", VIEW_SIZE)
        patch.setattr(block_process, "run_command", run_in_process)
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        out = S3Path(f"{address.removeprefix('s3://')}/town")
        here, there = textured(file, base / "out"), textured(file, out)
        assert here["atlas_digest"] == there["atlas_digest"]
        assert not there["failures"]
        yield file, out, base / "out", there


def test_nothing_is_due_when_it_is_done(cities: tuple[Path, S3Path, Path, dict[str, Any]]) -> None:
    file, out, _, first = cities
    again = textured(file, out)
    assert (again["blocks_done"], again["blocks_skipped"]) == (2, 2)
    assert again["atlas_digest"] == first["atlas_digest"]


def test_what_lies_over_its_blocks_leads_to_them(cities: tuple[Path, S3Path, Path, dict[str, Any]]) -> None:
    _, out, folder, _ = cities
    columns = ["id", "run", "building", "kind"]
    assert query(out)[columns].equals(query(folder)[columns])
    assert [len(one.runs) for one in read_merged_items_headers(out)] == [2]
    children = json.loads((out / "tileset.json").read_text())["root"]["children"]
    assert len(children) == 2
    assert all((out / child["content"]["uri"]).is_file() for child in children)
    assert (out / "overview.glb").read_bytes()[:4] == b"glTF"
    links = json.loads((out / "catalog.json").read_text())["links"]
    assert sum(link["rel"] == "child" for link in links) == 2


def test_commands_know_it(cities: tuple[Path, S3Path, Path, dict[str, Any]]) -> None:
    out, call = cities[1], CliRunner().invoke
    one, other = sorted(query(out)["run"].unique())
    reader = CityReader(out, is_locked)
    blocks = reader.describe()["blocks"]
    assert [f"blocks/{block['name']}" for block in blocks] == [one, other]
    assert all(block["published"] and block["outline"] and block["facades"] for block in blocks)
    assert [hit["id"] for hit in find_in_city(reader, "street 1")["found"] if hit["kind"] == "street"] == ["street 1"]
    told = call(command_line, ["metrics", str(out)]).stdout
    assert f'streetloom_units{{run="{other}",stage="facades",state="failed"}} 0.0' in told
    assert call(command_line, ["prune", str(out), "--keep", "1"]).stdout.count("removed 0 published snapshots") == 2
    said = call(command_line, ["doctor", str(out), "--json"])
    findings = json.loads(said.stdout)["findings"]
    known = {(found["concern"], found["state"], found["said"].partition(":")[0]) for found in findings}
    assert {(c, "ok", name) for c in ("store", "published", "units") for name in (one, other)} <= known, findings


def test_a_block_that_another_run_holds_stops_no_other(
    cities: tuple[Path, S3Path, Path, dict[str, Any]],
) -> None:
    """Another machine's, whose lock is good for an hour more."""
    file, out, _, first = cities
    held, name = S3Path(f"{out.parent.path}/held"), sorted(query(out)["run"].unique())[0]
    until = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    lock = json.dumps({"host": "elsewhere", "pid": 7, "run": "0" * 32, "until": until})
    object_store.upload_object(f"{held.path}/{name}/.lock", lock.encode())
    summary = textured(file, held)
    [failure] = summary["failures"]
    assert (failure["unit"], failure["code"]) == (f"block {name.removeprefix('blocks/')}", 2), failure
    assert "process 7 on 'elsewhere'" in failure["reason"]
    assert (summary["blocks_done"], summary["facades_done"]) == (1, first["facades_done"] / 2)
    assert len(json.loads((held / "tileset.json").read_text())["root"]["children"]) == 1


def test_a_block_of_it_is_seen_and_exported(cities: tuple[Path, S3Path, Path, dict[str, Any]], tmp_path: Path) -> None:
    from starlette.testclient import TestClient

    from flows.viewer.app import create_application

    out, call = cities[1], CliRunner().invoke
    name = sorted(query(out)["run"].unique())[0]
    with TestClient(
        create_application(RunReader(out / name), "127.0.0.1", "127.0.0.1"), base_url="http://127.0.0.1"
    ) as page:
        block = page.get("/api/block").json()
        assert {facade["status"] for facade in block["facades"]} == {"done"}
        [row] = page.get("/api/city").json()["blocks"]
        root = page.get(f"/tiles/{row['published']}/tileset.json").json()["root"]
        assert page.get(f"/tiles/{row['published']}/{root['children'][0]['content']['uri']}").content[:4] == b"glTF"
    refused = call(command_line, ["export", str(out), "--format", "glb", "--to", str(tmp_path / "all")])
    assert refused.exit_code == 2
    assert f"a block of it, such as {out}/{name}" in refused.stderr
    exported = call(command_line, ["export", f"{out}/{name}", "--format", "cityjson", "--to", str(tmp_path / "one")])
    assert exported.exit_code == 0, exported.output
    assert list((tmp_path / "one").glob("*.city.json"))


def test_stopped_by_the_clock_and_killed_it_goes_on_to_the_same(
    cities: tuple[Path, S3Path, Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, out, _, first = cities
    base, killed = file.parent, S3Path(f"{out.parent.path}/killed")
    monkeypatch.setattr(block_process, "run_command", TYPED)

    # a night that begins when it is to be over, by the flow
    late = SimpleNamespace(scheduled_start_time=datetime(2026, 3, 1, 1, 0, tzinfo=UTC))
    with monkeypatch.context() as patch:
        patch.setattr(flows_of_cities, "flow_run", late)
        patch.setattr(flows_of_cities, "publish_block_table", lambda account: None)
        state = flows_of_cities.city.fn(file, str(killed), until="06:00")
    assert state.name == "BlocksLeft"
    assert "0 of 2 blocks are done; 2 are left" in state.message
    names = [
        name for name, *_ in (path.name.partition(".") for path in (local_run_folder(killed) / "input").glob("*.yaml"))
    ]

    # one whose time is up soon after
    with monkeypatch.context() as patch:
        patch.setattr(flows_of_cities, "next_time_of_day", lambda until, since: datetime.now() + timedelta(seconds=2))
        stopped = textured(file, killed, until="06:00")
    assert sorted(stopped["left"]) == sorted(names), stopped["failures"]
    assert [one["code"] for one in stopped["failures"]] == [DEADLINE_EXIT_CODE]

    process = typed(file, killed, "--workers", "1")
    while not (begun := [name for name in names if len(done(killed / "blocks" / name)) > 2]):
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
    process.kill()
    said = "".join(process.communicate())
    wait_until(lambda: not working_in(killed / "blocks" / begun[0]))  # its process ends with the city's
    before = sum(len(done(killed / "blocks" / name)) for name in names)

    with machines(base / "machines") as cluster:
        cluster.worker("one")
        resumed = finish(typed(file, killed, "--dask", cluster.address, "--at-once", "2"))
    assert resumed["atlas_digest"] == first["atlas_digest"]
    assert not resumed["failures"]
    assert resumed["units_skipped"] >= before > 0
    assert list((local_run_folder(killed) / "prefect").glob("*.db")), "what the next test looks through"
    (base / "said.txt").write_text(said)


def typed(file: Path, out: S3Path, *more: str) -> subprocess.Popen:
    """A city's run without 3D Tiles, as a user starts it."""
    return subprocess.Popen(
        [sys.executable, "-m", "flows", "city", str(file), "--out", str(out), "--no-tiles", "--json", *more],
        cwd=ROOT,
        env=environment(file.parent),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_the_credentials_are_nowhere(cities: tuple[Path, S3Path, Path, dict[str, Any]]) -> None:
    """In no object, record, log, database of Prefect's or file that workers left, and nothing that was said."""
    file = cities[0]
    held = {name: object_store.download_object(f"city/{name}") for name in object_store.list_objects("city")}
    assert len(held) > 100
    here = [path for path in file.parent.rglob("*") if path.is_file()]
    assert {".jsonl", ".db", ".txt"} <= {path.suffix for path in here}, "what was said is among them"
    found = {name: one[0] for name, one in held.items() if one} | {str(path): path.read_bytes() for path in here}
    assert [name for name, data in found.items() if KEY.encode() in data or SECRET.encode() in data] == []
