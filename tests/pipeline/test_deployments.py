"""Deployments, typed as deploy/README.md gives them: a server, a worker, single and scheduled runs, and what they tell."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from uuid import UUID

import pytest
import yaml

from deploy.rehearsal.postgres import postgres, unfit
from facade_core.core.errors import StoreError
from flows.block import block_run_name
from flows.lock import lock_folder
from flows.server.startup import find_free_port
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import STAGE_NAMES
from tests.pipeline.deployed import (
    README,
    Site,
    automate,
    end,
    healthy,
    kill,
    left_running,
    listening,
    new_site,
    notified_at,
    running,
    runs,
    typed,
    until,
)
from tests.pipeline.runs import PATIENCE_S, ROOT, command, working_in
from tests.pipeline.stages import digests_of, texture, write_block, write_photo

if TYPE_CHECKING:
    from prefect.client.schemas.objects import FlowRun, State

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]

RUN = (
    """prefect deployment run city-block/dev --watch --param block_file='"blocks/mine.yaml"' --param out='"out/mine"'"""
)
WORKER = "prefect worker start --type process --pool streetloom"
ALONE = f"{RUN} --param workers=1"


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """PostgreSQL, as deploy/README.md has it for many runs: on SQLite a server that is loaded says that its database is locked,
    and drops events."""
    if reason := unfit():
        pytest.skip(reason)
    with postgres(tmp_path_factory.mktemp("postgres") / "server", "127.0.0.1", find_free_port()) as address:
        yield address


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, database: str) -> Iterator[Site]:
    """A server with both deployments, and a worker."""
    made = new_site(tmp_path_factory.mktemp("site") / "prefect", database)
    try:
        left_running(made, "prefect server start", "server.log")
        until(lambda: healthy(made), made)
        typed(made, "prefect work-pool create streetloom --type process")
        typed(made, "prefect deploy -n city-block/dev")
        left_running(made, WORKER, "worker.log")
        yield made
    finally:
        end(made)


@pytest.fixture(scope="module")
def finished(site: Site, smallest: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FlowRun, str]:
    """The smallest block, run through the deployment: its folder, its run, and what a second run there said meanwhile."""
    out = tmp_path_factory.mktemp("deployed") / "out"
    run = left_running(site, RUN, "run.log", {"blocks/mine.yaml": str(smallest), "out/mine": str(out)})
    until((out / "store").is_dir, site)
    second = subprocess.run(command(smallest, out, 1), cwd=ROOT, env=site.environment, capture_output=True, text=True)
    assert second.returncode == 2
    assert run.wait(PATIENCE_S) == 0
    return out, the_run(site, "dev"), second.stderr


def the_run(site: Site, deployment: str) -> FlowRun:
    """The newest run of a deployment that is not only scheduled."""
    return runs(site, deployment)[0]


def artifacts(site: Site, run: UUID) -> dict[str, tuple[Any, str]]:
    """The artifacts of a run: key without the block's name -> (data, description)."""
    from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterFlowRunId

    with site.client() as client:
        found = client.read_artifacts(
            artifact_filter=ArtifactFilter(flow_run_id=ArtifactFilterFlowRunId(any_=[run])),
        )
    shown = {}
    for artifact in found:
        assert artifact.key
        assert artifact.key.startswith("small-")
        data = artifact.data
        if artifact.type == "table":
            data = json.loads(str(data))
        shown[artifact.key.removeprefix("small-")] = (data, artifact.description or "")
    return shown


def test_the_clients_own_listing_is_answered(site: Site) -> None:
    """A server whose web framework is too new answers its own client with 422 (docs/decisions/0009)."""
    done = subprocess.run(
        ["prefect", "deployment", "ls"], env=site.environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "city-block/dev" in done.stdout


def test_a_run_completes_and_is_named_after_block_and_date(site: Site, finished: tuple[Path, FlowRun, str]) -> None:
    _, run, _ = finished
    assert run.state_name == "Completed"
    assert run.run_count == 1
    assert run.expected_start_time
    assert run.name == f"small {run.expected_start_time.astimezone(UTC):%Y-%m-%d %H:%M}"
    assert set(run.tags) >= {"streetloom", "dev"}


def test_tasks_are_named_after_what_they_do(site: Site, finished: tuple[Path, FlowRun, str]) -> None:
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId

    with site.client() as client:
        tasks = client.read_task_runs(flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=[finished[1].id])))
    names = {task.name for task in tasks}
    assert names >= {"ingest", "publish"}
    assert any(name.startswith("streets 1 of ") for name in names)
    for name in names - {"ingest", "publish"}:
        assert re.fullmatch(r"(exemplars|facades|streets|surfaces|pages|tiles|pictures) \d+ of \d+", name)


def test_the_same_atlas_as_without_deployments(
    smallest: Path, finished: tuple[Path, FlowRun, str], tmp_path: Path
) -> None:
    out, _, _ = finished
    snapshot = (out / "current").read_text().strip()
    summary = json.loads((out / "published" / snapshot / "summary.json").read_text())
    texture(smallest, tmp_path / "out")
    assert summary["atlas_digest"] == digests_of(tmp_path / "out")[0]
    for path in ("block.glb", "items.parquet", "report/index.html"):
        assert (out / "published" / snapshot / path).stat().st_size > 1000


def test_artifacts_tell_units_and_outputs(site: Site, finished: tuple[Path, FlowRun, str]) -> None:
    out, run, _ = finished
    shown = artifacts(site, run.id)
    assert set(shown) == {"progress", "units", "facades", "failures", "viewer", "report", "outputs"}
    assert shown["progress"][0] == 100
    records = [
        (stage, record["unit"])
        for stage in STAGE_NAMES
        for record in read_newest_journal(out / "store", stage)
        if record
    ]
    rows = shown["units"][0]
    assert sorted((row["stage"], row["unit"]) for row in rows) == sorted([("ingest", "small"), *records])
    assert {row["status"] for row in rows} == {"done"}
    assert all(row["seconds"] > 0 for row in rows if row["stage"] == "facades")
    assert shown["units"][1] == f"{len(rows)} units: {len(rows)} done in this run, 0 before, 0 failed, 0 refused"
    assert shown["failures"] == ([], "0 units failed, 0 refused, and why")
    assert "http://127.0.0.1:8710/" in shown["viewer"][0]
    assert f"`streetloom view {out}`" in shown["viewer"][1]
    assert "](http://127.0.0.1:8710/)" in shown["outputs"][0]
    facades = shown["facades"][0]
    assert {row["id"] for row in facades} == {unit for stage, unit in records if stage == "facades"}
    assert all(row["quality"] for row in facades)
    assert all(row["windows"] > 0 for row in facades if row["role"] == "street")
    published = (out / "published" / (out / "current").read_text().strip()).resolve()
    assert (published / "report" / "index.html").as_uri() in shown["report"][0]
    for path in ("block.glb", "items.parquet", "report/index.html"):
        assert str(published / path) in shown["outputs"][0]


def test_a_second_run_in_the_folder_is_refused(finished: tuple[Path, FlowRun, str]) -> None:
    out, _, said = finished
    assert said.strip().splitlines() == [
        f"streetloom: {out}: another run is at work in it; wait for it, or name another folder with --out"
    ]


def test_a_schedule_fires_and_skips_what_is_done(
    site: Site, smallest: Path, finished: tuple[Path, FlowRun, str], tmp_path: Path
) -> None:
    """The README's own example of a deployment, with an interval short enough for a test."""
    out, first, _ = finished
    example = README.split("```yaml\n")[1].split("```")[0]
    keys = yaml.safe_load(example.replace("/where/streetloom/is", str(ROOT)))
    (mine,) = keys["deployments"]
    mine["parameters"] = {"block_file": str(smallest), "out": str(out)}
    anchor = datetime.now(UTC) + timedelta(seconds=40)
    mine["schedules"] = [{"interval": 120, "anchor_date": anchor.isoformat(timespec="seconds")}]
    (tmp_path / "prefect.yaml").write_text(yaml.safe_dump(keys))
    own = {"blocks/prefect.yaml": str(tmp_path / "prefect.yaml")}
    typed(site, "prefect deploy --prefect-file blocks/prefect.yaml -n mine", own)
    until(lambda: runs(site, "mine"), site)  # made by the server, taken by the worker

    with site.client() as client:
        deployment = client.read_deployment_by_name("city-block/mine")
    (schedule,) = deployment.schedules
    assert str(schedule.id)[:8] in typed(site, "prefect deployment schedule ls city-block/mine")
    assert runs(site, "mine", scheduled=True)  # the next ones are waiting
    typed(site, "prefect deployment schedule pause city-block/mine SCHEDULE", {"SCHEDULE": str(schedule.id)})
    assert not runs(site, "mine", scheduled=True)
    until(lambda: runs(site, "mine")[-1].end_time, site)
    *_, run = runs(site, "mine")  # a loaded machine may have begun another before the schedule was paused
    assert run.auto_scheduled
    assert run.state_name == "Completed"
    count = len(artifacts(site, first.id)["units"][0])
    assert (
        artifacts(site, run.id)["units"][1] == f"{count} units: 0 done in this run, {count} before, 0 failed, 0 refused"
    )


def test_a_broken_photo_is_refused_and_the_run_completed(site: Site, tmp_path: Path) -> None:
    """One of two photos is cut off, the other astray."""
    for facade in ("a-0", "b-0"):
        write_photo(tmp_path / "in", facade, 1)
    block = write_block(tmp_path / "in")
    broken, other = sorted((tmp_path / "in" / "photos").iterdir())
    astray = other.rename(other.with_name("w999-0.png"))  # no facade has this id
    broken.write_bytes(broken.read_bytes()[: broken.stat().st_size // 2])
    typed(site, ALONE, {"blocks/mine.yaml": str(block), "out/mine": str(tmp_path / "out")})
    run = the_run(site, "dev")
    assert run.state
    assert (run.state.type.value, run.state.name) == ("COMPLETED", "Completed")
    shown = artifacts(site, run.id)
    reasons = {failure["unit"]: failure["reason"] for failure in shown["failures"][0]}
    assert reasons.keys() == {broken.stem, astray.name}
    assert broken.name in reasons[broken.stem]
    assert "no facade has the id" in reasons[astray.name]
    told = {(row["stage"], row["unit"], row["status"]) for row in shown["units"][0][:2]}
    assert told == {("facades", broken.stem, "refused"), ("ingest", astray.name, "refused")}
    assert (tmp_path / "out" / "current").is_file()


def test_an_unusable_block_file_fails_the_run_at_once(site: Site, tmp_path: Path) -> None:
    block = tmp_path / "bad.yaml"
    block.write_text("name: mine\nbuildigs: {path: a.pbf}\n")
    typed(site, ALONE, {"blocks/mine.yaml": str(block), "out/mine": str(tmp_path / "out")}, expect=1)
    run = the_run(site, "dev")
    assert run.state
    assert run.state_name == "Failed"
    assert run.run_count == 1
    assert run.name.startswith("mine 20")
    message = run.state.message or ""
    assert f"{block}: line 2: buildigs: unknown key" in message
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize(
    ("content", "name"), [(None, "there"), ("- a\n", "there"), ("crs: EPSG:3857\n", "there"), ("name: mine\n", "mine")]
)
def test_a_run_has_a_name_whatever_the_block_file_holds(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: str | None, name: str
) -> None:
    block = tmp_path / "there.yaml"
    if content:
        block.write_text(content)
    started = SimpleNamespace(
        parameters={"block_file": str(block)}, scheduled_start_time=datetime(2026, 3, 1, 1, tzinfo=UTC)
    )
    monkeypatch.setattr("flows.block.flow_run", started)
    assert block_run_name() == f"{name} 2026-03-01 01:00"


def test_nightly_is_deployed_as_written(site: Site) -> None:
    typed(site, "prefect deploy -n city-block/nightly")
    with site.client() as client:
        deployment = client.read_deployment_by_name("city-block/nightly")
        client.delete_deployment(deployment.id)  # it must not begin a run at two o'clock
    nightly = deployment.model_dump(mode="json")
    (schedule,) = nightly["schedules"]
    assert schedule["active"]
    assert (schedule["schedule"]["cron"], schedule["schedule"]["timezone"]) == ("0 2 * * *", "Europe/Amsterdam")
    assert nightly["global_concurrency_limit"]["limit"] == 1
    assert nightly["concurrency_options"]["collision_strategy"] == "CANCEL_NEW"
    assert int(nightly["job_variables"]["env"]["PREFECT_FLOWS_DEFAULT_RETRIES"]) == 2
    assert int(nightly["job_variables"]["env"]["PREFECT_FLOWS_DEFAULT_RETRY_DELAY_SECONDS"]) == 60
    assert set(nightly["tags"]) == {"streetloom", "nightly"}
    assert nightly["parameters"] == {"block_file": None, "out": "out/nightly", "workers": 2, "deadline": 22, "keep": 14}
    (step,) = nightly["pull_steps"]
    assert step == {"prefect.deployments.steps.set_working_directory": {"directory": str(ROOT)}}


def test_a_run_whose_worker_is_killed_before_it_starts_is_crashed_and_the_next_one_starts(
    site: Site, tmp_path: Path
) -> None:
    """Its place in `nightly`, which cancels what finds none, comes back though the server was started anew meanwhile."""
    told: list[str] = []
    automations = (ROOT / "deploy" / "automations.yaml").read_text()
    (tmp_path / "automations.yaml").write_text(automations.replace("within: 900", "within: 15"))
    bad = tmp_path / "bad.yaml"
    bad.write_text("name: mine\nbuildigs: {path: a.pbf}\n")
    with listening(told.append) as address:
        notified_at(site, address)
        automate(site, tmp_path / "automations.yaml")
        typed(site, "prefect deploy -n city-block/nightly")
        first = begin(site, bad)
        until(lambda: state(site, first).type.value == "PENDING", site)
        kill(site, WORKER)
        kill(site, "prefect server start")
        left_running(site, "prefect server start", "server again.log")
        until(lambda: healthy(site), site)
        left_running(site, WORKER, "worker again.log")
        until(lambda: state(site, first).name == "Crashed", site)
        automate(site, ROOT / "deploy" / "automations.yaml")  # those of the same names go
        second = begin(site, bad)
        until(lambda: state(site, second).is_final(), site)
        assert state(site, second).name == "Failed"
        assert "buildigs: unknown key" in (state(site, second).message or "")
        until(lambda: any("buildigs: unknown key" in line for line in told), site)


def test_a_night_in_which_no_run_ended_well_is_told(site: Site, tmp_path: Path) -> None:
    """The alarm of deploy/automations.yaml, with seconds for hours; it counts from the last run that ended well."""
    from prefect import flow
    from prefect.states import Completed

    told: list[str] = []
    (entry,) = [
        one for one in yaml.safe_load((ROOT / "deploy" / "automations.yaml").read_text()) if "nightly" in one["name"]
    ]
    assert entry["trigger"]["within"] == 26 * 3600
    entry["trigger"]["within"] = 10  # the least that Prefect takes
    (tmp_path / "missed.yaml").write_text(yaml.safe_dump([entry]))
    with listening(told.append) as address, site.client() as client:
        notified_at(site, address)
        made = subprocess.run(
            [sys.executable, "deploy/automations.py", str(tmp_path / "missed.yaml"), "--notify", "custom-webhook/team"],
            cwd=ROOT,
            env=site.environment,
            capture_output=True,
            text=True,
        )
        assert made.returncode == 0, made.stderr
        good = client.create_flow_run(flow(lambda: None, name="good"), tags=["nightly"])
        client.set_flow_run_state(good.id, Completed(), force=True)
        until(lambda: any("is a worker polling" in line for line in told), site)
        for automation in client.read_automations_by_name(entry["name"]):
            client.delete_automation(automation.id)


def begin(site: Site, block: Path) -> UUID:
    with site.client() as client:
        nightly = client.read_deployment_by_name("city-block/nightly")
        parameters = {"block_file": str(block), "out": str(block.parent / "out"), "workers": 1}
        return client.create_flow_run_from_deployment(nightly.id, parameters=parameters).id


def state(site: Site, run: UUID) -> State:
    with site.client() as client:
        found = client.read_flow_run(run).state
    assert found
    return found


def test_a_run_that_is_cancelled_ends_and_the_next_goes_on(site: Site, smallest: Path, tmp_path: Path) -> None:
    from prefect.client.schemas.objects import StateType
    from prefect.states import Cancelling

    run = ordered(site, smallest, tmp_path / "out")
    until(lambda: held(tmp_path / "out", "facades"), site)
    with site.client() as client:
        client.set_flow_run_state(run, Cancelling())
        until(lambda: client.read_flow_run(run).state_type == StateType.CANCELLED, site)
    until(lambda: not working_in(tmp_path / "out"), site)
    before = held(tmp_path / "out", "facades")
    again = until_ended(site, ordered(site, smallest, tmp_path / "out"))
    assert again.state_name == "Completed"
    assert [record["started"] for record in held(tmp_path / "out", "facades")[: len(before)]] == [
        record["started"] for record in before
    ]


def test_a_run_that_fails_is_tried_again(site: Site, smallest: Path, tmp_path: Path) -> None:
    """The folder is another run's while the first try begins."""
    retries = {"PREFECT_FLOWS_DEFAULT_RETRIES": "2", "PREFECT_FLOWS_DEFAULT_RETRY_DELAY_SECONDS": "1"}
    with lock_folder(tmp_path / "out"):
        run = ordered(site, smallest, tmp_path / "out", retries)
        with site.client() as client:
            until(lambda: client.read_flow_run(run).state_name == "AwaitingRetry", site)
    ended = until_ended(site, run)
    assert ended.state_name == "Completed"
    assert ended.run_count in (2, 3)
    assert (tmp_path / "out" / "current").is_file()


def ordered(site: Site, block: Path, out: Path, environment: dict[str, str] | None = None) -> UUID:
    """A run of the deployment `dev` that is asked for, and not waited for."""
    with site.client() as client:
        deployment = client.read_deployment_by_name("city-block/dev")
        return client.create_flow_run_from_deployment(
            deployment.id,
            parameters={"block_file": str(block), "out": str(out), "workers": 1},
            job_variables={"env": environment or {}},
        ).id


def until_ended(site: Site, run: UUID) -> FlowRun:
    with site.client() as client:
        until(lambda: client.read_flow_run(run).end_time, site)
        return client.read_flow_run(run)


def held(out: Path, stage: str) -> list[dict[str, Any]]:
    """The records of a stage that are there."""
    try:
        return [record for record in read_newest_journal(out / "store", stage) if record]
    except (StoreError, KeyError, FileNotFoundError):
        return []


def test_nothing_runs_afterwards(site: Site) -> None:
    assert len(running(site)) >= 2  # the server and the worker
    assert end(site) == []
