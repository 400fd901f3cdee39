"""A run in a bucket: killed and resumed, refused to a second, asked, viewed, exported, pruned, examined; no secret anywhere."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import geopandas
import pytest
from click.testing import CliRunner

import catalogs
from catalogs.block.corrections import corrections_file, read_corrections
from catalogs.published import object_store
from catalogs.published.file_list import find_snapshot_damage
from catalogs.published.folders import local_run_folder
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import current_snapshot
from catalogs.query.execution import query
from facade_core.atlas.snapshot import open_atlas
from facade_core.core.errors import FacadeError, InputError
from flows.cli.commands import command_line
from flows.lock import lock_folder
from tasks.engine.compute.worker_setup import inspect_worker
from tasks.engine.store.commits import fork_store, read_newest_journal
from tasks.publish.prune import prune_snapshots
from tasks.stages.order import STAGE_NAMES
from tasks.viewing.run_view import RunReader
from tests.bucket import SECRET, served
from tests.pipeline.runs import PATIENCE_S
from tests.pipeline.stages import VIEW_SIZE, write_block

# One street and the two buildings at it.
BUILDINGS = {"a": (4, 5, 12, 2.8, 7.0), "b": (24, -8, 12, 2.8, 9.0)}
STREETS = {"1": [(0, 0), (45, 0)]}
# A run without Prefect's server, in a process of its own, that draws small pictures.
RUN = f"""
import json, sys
from pathlib import Path
from catalogs.published.s3 import folder_at
import facade_core.export.pictures.views
facade_core.export.pictures.views.VIEW_SIZE = {VIEW_SIZE}
from flows.block import texture_block
if __name__ == "__main__":
    print(json.dumps(texture_block(Path(sys.argv[1]), folder_at(sys.argv[2]), workers=int(sys.argv[3]))))
"""

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]


@dataclass(frozen=True)
class Runs:
    """The same block in a folder, undisturbed, and in a bucket, where its run was killed: both summaries, and what all said."""

    block: Path
    folder: Path
    out: S3Path
    undisturbed: dict[str, Any]
    resumed: dict[str, Any]
    done_before: int
    said: str


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runs]:
    base = tmp_path_factory.mktemp("bucket")
    with served("nights") as address, pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_CACHE_HOME", str(base / "cache"))
        script = base / "run.py"
        script.write_text(RUN)
        block = write_block(base / "in", buildings=BUILDINGS, streets=STREETS)
        out = S3Path(f"{address.removeprefix('s3://')}/small")
        whole = begun(script, block, str(base / "folder"), 1)
        undisturbed, said = ended(whole)
        killed = begun(script, block, str(out), 1)
        while len(done(out)) < 3:
            assert killed.poll() is None, killed.communicate()
            time.sleep(0.1)
        with monkeypatched_cache(base / "elsewhere"), pytest.raises(InputError) as refused, lock_folder(out):
            pass
        assert f"process {killed.pid} on" in str(refused.value)
        killed.send_signal(signal.SIGKILL)
        said += "".join(killed.communicate())
        before = done(out)
        # the next run is on the same machine: it does not wait until the lock is over
        resumed, more = ended(begun(script, block, str(out), 2))
        yield Runs(block, base / "folder", out, undisturbed, resumed, len(before), said + more)


def monkeypatched_cache(folder: Path) -> Any:
    context = pytest.MonkeyPatch.context()

    class Moved:
        def __enter__(self) -> None:
            context.__enter__().setenv("XDG_CACHE_HOME", str(folder))

        def __exit__(self, *error: object) -> None:
            context.__exit__(None, None, None)

    return Moved()


def begun(script: Path, block: Path, out: str, workers: int) -> subprocess.Popen[str]:
    command = [sys.executable, str(script), str(block), out, str(workers)]
    path = str(Path(__file__).resolve().parents[2])
    # where a worker begins says nothing of where the run is
    return subprocess.Popen(
        command,
        cwd=script.parent,
        env=os.environ | {"PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process: subprocess.Popen[str]) -> tuple[dict[str, Any], str]:
    """A run's summary, and all that it printed."""
    printed, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, said
    return json.loads(printed.splitlines()[-1]), printed + said


def done(out: S3Path) -> list[str]:
    """The units that the store holds as done."""
    with suppress(FacadeError, KeyError, FileNotFoundError):
        return [
            r["unit"]
            for stage in STAGE_NAMES
            for r in read_newest_journal(out / "store", stage)
            if r and r["status"] == "done"
        ]
    return []


def test_a_killed_run_goes_on_to_the_same_atlas(runs: Runs) -> None:
    assert runs.resumed["atlas_digest"] == runs.undisturbed["atlas_digest"]
    assert runs.resumed["units_skipped"] >= runs.done_before
    assert runs.resumed["failures"] == []
    assert runs.resumed["outputs"]["items"].startswith(f"{runs.out}/published/")


def test_what_it_published_is_whole_and_the_same(runs: Runs) -> None:
    here, there = current_snapshot(runs.folder), current_snapshot(runs.out)
    assert find_snapshot_damage(there.folder, thorough=True) is None
    assert there.model.read_bytes() == here.model.read_bytes()
    left = {"updated", "seconds", "run"}
    for kind in ("facade", "page"):
        columns = [column for column in query(runs.folder).columns if column not in left]
        rows = [query(place, where=f"kind = '{kind}'")[columns] for place in (runs.folder, runs.out)]
        assert rows[0].equals(rows[1])
    links = json.loads((runs.out / "catalog.json").read_text())["links"]
    assert all((runs.out / link["href"].removeprefix("./")).is_file() for link in links)
    at_top = {name.partition("/")[0] for name in runs.out.sizes()}
    assert at_top == {"store", "published", "current", "catalog.json", "source"}, "nothing else is left there"


def test_python_and_commands_open_it(runs: Runs, tmp_path: Path) -> None:
    facade = query(runs.out, where="kind = 'facade'").id[0]
    rasters = [catalogs.open(place).facade(facade) for place in (str(runs.out), runs.folder)]
    assert rasters[0].identical(rasters[1])
    assert open_atlas(catalogs.folder_at(str(runs.out))).facade(facade).sizes == rasters[0].sizes
    call = CliRunner().invoke
    for style, name in (("glb", ""), ("gpkg", "a.gpkg")):
        exported = call(
            command_line, ["export", str(runs.out), "--format", style, "--to", str(tmp_path / (name or style))]
        )
        assert exported.exit_code == 0, exported.output
    # what is corrected of it is kept beside its block file, which lies in no bucket
    walls = geopandas.read_file(tmp_path / "a.gpkg", layer="facades")
    for said in ("nothing differs from what was published", "1 facade and 0 buildings corrected in"):
        taken = call(command_line, ["import", str(runs.out), str(tmp_path / "a.gpkg")])
        assert said in taken.output
        walls.assign(is_facade=walls["id"] != facade).to_file(tmp_path / "a.gpkg", layer="facades")
    assert read_corrections(runs.block).value_correction(facade, "facade") is False
    corrections_file(runs.block).unlink()
    refused = call(command_line, ["export", str(runs.out), "--format", "glb", "--building", "a"])
    assert refused.exit_code == 2
    assert "--to" in refused.stderr
    examined = call(command_line, ["doctor", str(runs.out), "--json"])
    findings = {(one["concern"], one["state"]) for one in json.loads(examined.stdout)["findings"]}
    assert {("store", "ok"), ("published", "ok"), ("units", "ok")} <= findings, examined.output


def test_the_page_shows_it(runs: Runs) -> None:
    from starlette.testclient import TestClient

    from flows.viewer.app import create_application

    with TestClient(
        create_application(RunReader(runs.out), "127.0.0.1", "127.0.0.1"), base_url="http://127.0.0.1"
    ) as page:
        block = page.get("/api/block").json()
        assert {facade["status"] for facade in block["facades"]} == {"done"}
        assert page.get("/api/progress").json()["ended"]
        [row] = page.get("/api/city").json()["blocks"]
        root = page.get(f"/tiles/{row['published']}/tileset.json").json()["root"]
        for tile in (root, root["children"][0]):
            assert page.get(f"/tiles/{row['published']}/{tile['content']['uri']}").content[:4] == b"glTF"
        assert page.get("/picture/panorama?viewpoint=0").content[:2] == b"\xff\xd8"


def test_workers_are_asked_whether_they_reach_the_bucket(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    token = runs.out / ".seen-test"
    token.touch()
    assert inspect_worker(str(token))[0]
    token.unlink()
    assert not inspect_worker(str(token))[0]
    assert not [name for name in runs.out.sizes() if name.startswith(".seen-")]
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    assert not inspect_worker(str(token))[0]


def test_older_snapshots_stay_for_an_hour_and_then_go(runs: Runs) -> None:
    """On a copy: another snapshot is published before the one that `current` names."""
    copy, first = S3Path(f"{runs.out.parent.path}/copy"), current_snapshot(runs.out).id
    for name in runs.out.sizes():
        object_store.copy_object(f"{runs.out.path}/{name}", f"{copy.path}/{name}")
    older = "0LDER0LDER0LDER0LDER"
    for name in (copy / "published" / first).sizes():
        object_store.copy_object(f"{copy.path}/published/{first}/{name}", f"{copy.path}/published/{older}/{name}")
    object_store.upload_object(f"{copy.path}/published/half/items.parquet", b"of a run that was killed as it published")
    said = prune_snapshots(copy, 1)
    assert "removed 0 published snapshots" in said[0]
    assert "1 leftovers" in said[0]
    assert f"kept {older}, which somebody may read" in said[1]
    said = prune_snapshots(copy, 1, read_for=timedelta())
    assert "removed 1 published snapshots" in said[0]
    assert [path.name for path in (copy / "published").iterdir()] == [first]
    assert find_snapshot_damage(current_snapshot(copy).folder) is None
    assert len(query(copy)) == len(query(runs.out))
    assert done(copy) == done(runs.out)


def test_the_secret_is_nowhere(runs: Runs) -> None:
    held = {name: object_store.download_object(f"nights/{name}") for name in object_store.list_objects("nights")}
    assert len(held) > 100
    leaks = [name for name, found in held.items() if found and SECRET.encode() in found[0]]
    local = [path for path in local_run_folder(runs.out).rglob("*") if path.is_file()]
    assert any(path.suffix == ".jsonl" for path in local), "the log is on this machine"
    leaks += [str(path) for path in local if SECRET.encode() in path.read_bytes()]
    assert leaks == []
    assert SECRET not in runs.said
    _, fork = fork_store(runs.out / "store")
    assert SECRET.encode() not in pickle.dumps(fork), "workers take the credentials of their own environment"
