"""Texture one street, viewpoint by viewpoint, in order."""

from __future__ import annotations

import time
from collections.abc import Sequence

import icechunk
import zarr
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.features import file_stem
from facade_core.atlas.journal import latest_chunks, read_journal, seed_records, unit_key
from facade_core.atlas.store import BRANCH, open_repository
from facade_core.atlas.zarr_types import StoreGroup
from tasks.cluster import ClusterGone
from tasks.commits import begin, finish
from tasks.compute import Compute
from tasks.outcome import Outcome, failure, is_done
from tasks.plan import read_plan
from tasks.progress import advance
from tasks.run import Run
from tasks.units.viewpoint import street_unit, viewpoint_unit


@task(name="street", task_run_name="street {title}", cache_policy=NO_CACHE)
def texture_street(run: Run, street: int, title: str, memory: int, compute: Compute) -> Outcome:
    """Every viewpoint not yet journalled, one commit each, then the street's texels in one commit, tagged.

    One worker keeps the street's state of `memory` bytes; where it is lost, another rebuilds that from the panoramas.
    """
    with compute.lease(memory) as worker:
        return _texture(run, street, compute, worker)


def _texture(run: Run, street: int, compute: Compute, worker: str) -> Outcome:
    session = open_repository(run.store).readonly_session(BRANCH)
    plan = read_plan(session, run.texels_per_metre)
    group: StoreGroup = zarr.open_group(session.store, mode="r")
    wave, name = int(plan.wave[street]), plan.streets[street].id
    own = [v.id for v in plan.viewpoints if v.street == street]

    done_streets = read_journal(group, "streets")
    before = latest_chunks(
        seed_records(group), [r for r in done_streets if r and r["status"] == "done" and r["wave"] < wave]
    )
    charts = sorted({int(c) for v, c in plan.views if plan.viewpoints[v].street == street})
    cells = {
        "/".join(map(str, cell))
        for chart in charts
        for cell in plan.scene.placement.chunks(chart, plan.scene.spec.chunk, plan.scene.spec.gutter).tolist()
    }
    street_key = unit_key(run.key, "street", name, {cell: before[cell] for cell in cells if cell in before})
    keys = _chain(street_key, own)
    held = read_journal(group, "viewpoints")
    if is_done(done_streets[street], street_key):
        advance("viewpoints", len(own))
        return Outcome(skipped=len(own) + 1)
    first = next((k for k, v in enumerate(own) if not is_done(held[v], keys[k])), len(own))
    outcome = Outcome(skipped=first)
    advance("viewpoints", first)
    step = first
    commits: list[float] = []
    try:
        for step in range(first, len(own)):
            session, fork = begin(run.store)
            fork, record = compute.submit(viewpoint_unit, run, fork, street, step, street_key, worker=worker).result()
            record |= {"unit": f"{name}/{step}", "key": keys[step], "status": "done"}
            started = time.perf_counter()
            finish(session, fork, "viewpoints", {own[step]: record}, f"viewpoint {name}/{step}")
            commits.append(round(time.perf_counter() - started, 4))
            outcome = outcome.add([record])
            advance("viewpoints", 1)
        session, fork = begin(run.store)
        fork, record = compute.submit(street_unit, run, fork, street, len(own), street_key, worker=worker).result()
    except ClusterGone:
        raise
    except Exception as error:
        session, fork = begin(run.store)
        record = failure(name, street_key, error) | {"wave": wave, "chunks": {}}
        record["reason"] = f"viewpoint {step}: {record['reason']}"
        finish(session, fork, "streets", {street: record}, f"street {name} failed")
        return outcome.add([record])
    record |= {"unit": name, "key": street_key, "status": "done", "wave": wave, "commits": commits}
    snapshot = finish(session, fork, "streets", {street: record}, f"street {name}")
    _tag(run, f"street-{file_stem(name)}-{street_key[:12]}", snapshot)
    return outcome.add([record])


def _chain(street_key: str, viewpoints: Sequence[int]) -> list[str]:
    """Keys of a street's viewpoints: each stands on the one before it."""
    keys, key = [], street_key
    for viewpoint in viewpoints:
        key = unit_key(key, viewpoint)
        keys.append(key)
    return keys


def _tag(run: Run, tag: str, snapshot: str) -> None:
    repository = open_repository(run.store)
    if tag not in repository.list_tags():
        try:
            repository.create_tag(tag, snapshot)
        except (
            icechunk.IcechunkError
        ):  # a tag once deleted cannot be made again; the snapshot stays reachable from main
            return
