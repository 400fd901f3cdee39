"""A city of two blocks in a bucket is that of a folder; its blocks are run in this process, which starts none for each."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner

import facade_core.export.views
from catalogs.published import objects
from catalogs.published.joined import joined_in
from catalogs.published.places import Folder
from catalogs.published.s3 import S3Folder, folder_at
from catalogs.query import query
from flows.asked import Asked
from flows.block import unrecorded_block
from flows.city import unrecorded_city
from flows.cli.commands import main
from tasks.city import running
from tasks.export.formats import export
from tests.bucket import SECRET, served
from tests.pipeline.stages import VIEW_SIZE, write_block
from tests.pipeline.test_city import HOUSES, STREETS

pytestmark = pytest.mark.timeout(1200)


def called(arguments: Sequence[str], ends: float | None) -> running.Called:
    """What the command line does with some arguments, here."""
    if arguments[0] == "run":
        summary = unrecorded_block(Path(arguments[1]), folder_at(arguments[3]), workers=1)
        return running.Called(0, "", json.dumps(summary, default=str), 0.0)
    export(folder_at(arguments[1]), arguments[3])
    return running.Called(0, "", "", 0.0)


def textured(file: Path, out: Folder) -> dict[str, Any]:
    return unrecorded_city(file, out, Asked(workers=1))


@pytest.fixture(scope="module")
def cities(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, S3Folder, Path, dict[str, Any]]]:
    base = tmp_path_factory.mktemp("city")
    file = write_block(base, buildings=HOUSES, streets=STREETS)
    keys = yaml.safe_load(file.read_text()) | {"name": "town", "cut": {"metres": 70}}
    file.write_text(yaml.safe_dump(keys))
    with served("city") as address, pytest.MonkeyPatch.context() as patch:
        patch.setattr(facade_core.export.views, "VIEW_SIZE", VIEW_SIZE)
        patch.setattr(running, "_called", called)
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        out = S3Folder(f"{address.removeprefix('s3://')}/town")
        here, there = textured(file, base / "out"), textured(file, out)
        assert here["atlas_digest"] == there["atlas_digest"]
        assert not there["failures"]
        yield file, out, base / "out", there


def test_nothing_is_due_when_it_is_done(cities: tuple[Path, S3Folder, Path, dict[str, Any]]) -> None:
    file, out, _, first = cities
    again = textured(file, out)
    assert (again["blocks_done"], again["blocks_skipped"]) == (2, 2)
    assert again["atlas_digest"] == first["atlas_digest"]


def test_what_lies_over_its_blocks_leads_to_them(cities: tuple[Path, S3Folder, Path, dict[str, Any]]) -> None:
    _, out, folder, _ = cities
    columns = ["id", "run", "building", "kind"]
    assert query(out)[columns].equals(query(folder)[columns])
    assert [len(one.runs) for one in joined_in(out)] == [2]
    children = json.loads((out / "tileset.json").read_text())["root"]["children"]
    assert len(children) == 2
    assert all((out / child["content"]["uri"]).is_file() for child in children)
    assert (out / "overview.glb").read_bytes()[:4] == b"glTF"
    links = json.loads((out / "catalog.json").read_text())["links"]
    assert sum(link["rel"] == "child" for link in links) == 2


def test_commands_know_it(cities: tuple[Path, S3Folder, Path, dict[str, Any]]) -> None:
    out, call = cities[1], CliRunner().invoke
    one, other = sorted(query(out)["run"].unique())
    refused = call(main, ["view", str(out), "--no-open"])
    assert refused.exit_code == 2
    assert f"holds 2 runs ({one}, {other}); open one: streetloom view {out}/{one}" in refused.output
    told = call(main, ["metrics", str(out)]).stdout
    assert f'streetloom_units{{run="{other}",stage="facades",state="failed"}} 0.0' in told
    assert call(main, ["prune", str(out), "--keep", "1"]).stdout.count("removed 0 published snapshots") == 2
    said = call(main, ["doctor", str(out), "--json"])
    findings = json.loads(said.stdout)["findings"]
    known = {(found["concern"], found["state"], found["said"].partition(":")[0]) for found in findings}
    assert {(c, "ok", name) for c in ("store", "published", "units") for name in (one, other)} <= known, findings


def test_the_secret_is_nowhere(cities: tuple[Path, S3Folder, Path, dict[str, Any]]) -> None:
    file = cities[0]
    held = {name: objects.get(f"city/{name}") for name in objects.listed("city")}
    assert len(held) > 100
    leaks = [name for name, found in held.items() if found and SECRET.encode() in found[0]]
    here = [path for path in file.parent.rglob("*") if path.is_file()]
    assert any(path.suffix == ".jsonl" for path in here), "logs are among them"
    assert [*leaks, *(str(path) for path in here if SECRET.encode() in path.read_bytes())] == []
