"""Task of `streets`: texture one street, viewpoint by viewpoint."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import cast

import icechunk
import numpy as np
from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.arrays import STAGE_ARRAYS, clear_rasters
from facade_core.atlas.journal import clear_record, latest_chart_digests, read_journal, read_records
from facade_core.atlas.rasters import TexelLayout, chart_digests, read_rasters
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.errors import StoreError
from facade_core.plan.plan import Plan
from tasks.engine.compute.connect import Compute
from tasks.engine.context import load_run_plan
from tasks.engine.outcome import (
    UnitOutcomeCounts,
    failure_record,
    is_done_for_keys,
    is_machine_fault,
    log_units,
    machine_error,
)
from tasks.engine.progress import report_progress
from tasks.engine.run import Run
from tasks.engine.store.carry_over import delete_unit_results
from tasks.engine.store.commits import commit_units, fork_store
from tasks.stages.shared.base_layer import BASE_LAYER_STAGES
from tasks.stages.streets.keys import street_keys
from tasks.stages.streets.record import StreetRecord, ViewpointRecord
from tasks.stages.streets.redo import street_read_write_chunks
from tasks.stages.streets.tags import street_commit_tag
from tasks.stages.streets.worker import process_viewpoints, write_street_texels


def record_partial_run(run: Run, partial: bool) -> None:
    """Record in the store whether the last run left streets out: then more is pending than the records show."""
    session = open_repository(run.store).writable_session(BRANCH)
    root = open_root(session)
    if bool(root.attrs.get("partial", False)) != partial:
        root.attrs["partial"] = partial
        commit(session, "streets were left out" if partial else "no street is left out")


def find_finished_streets(
    run: Run, streets: Sequence[int], after: Sequence[Sequence[int]]
) -> dict[int, UnitOutcomeCounts]:
    """Find the streets without pending work, with their outcomes, in one pass over the journals.

    A street that waits for one with pending work is not among them. Only for translators that return a material field.

    Parameters
    ----------
    streets : in the order of their waves.
    after : for each street of the block, the streets that it waits for.
    """
    group = open_root(open_repository(run.store).readonly_session(BRANCH))
    records = read_journal(group, "streets")
    if run.texture.translator == "neural" or not any(records[street] for street in streets):
        return {}
    plan = load_run_plan(run)
    journals = {stage: read_journal(group, stage) for stage in (*BASE_LAYER_STAGES, "viewpoints")}
    found: dict[int, UnitOutcomeCounts] = {}
    chosen = set(streets)
    for street in streets:
        if not chosen.intersection(after[street]) <= found.keys():
            continue
        keys = street_keys(run, plan, group, street, journals)
        held = [journals["viewpoints"][viewpoint.id] for viewpoint in plan.street_viewpoints(street)]
        if is_done_for_keys(records[street], keys.street) and all(map(is_done_for_keys, held, keys.viewpoints)):
            found[street] = UnitOutcomeCounts(skipped=len(held) + 1)
            report_progress("viewpoints", earlier=len(held))
    return found


@task(name="street", task_run_name="street {title}", cache_policy=NO_CACHE)
def texture_street(run: Run, street: int, title: str, memory: int, compute: Compute) -> UnitOutcomeCounts:
    """Texture the pending viewpoints of a street, about a second of work per commit, then its texels in one tagged commit.

    Units go to the worker that keeps the street's state of `memory` bytes. Another worker rebuilds the state from the
    panoramas.
    """
    plan = load_run_plan(run)
    session = open_repository(run.store).readonly_session(BRANCH)
    group = open_root(session)
    wave, name = int(plan.wave[street]), plan.streets[street].id
    own = [v.id for v in plan.street_viewpoints(street)]
    reads, writes = street_read_write_chunks(plan, street)
    found = street_keys(run, plan, group, street)
    street_key, keys = found.street, found.viewpoints
    held = read_records(group, "viewpoints", np.array(own, np.int64))
    due = [k for k in range(len(own)) if not is_done_for_keys(held[k], keys[k])]
    done = is_done_for_keys(read_records(group, "streets", np.array([street]))[0], street_key)
    outcome = UnitOutcomeCounts(skipped=len(own) - len(due) + done)
    report_progress("viewpoints", earlier=len(own) - len(due))
    if done and not due:
        return outcome
    # who reads them later must not take them for what this street shows now
    delete_unit_results(run, plan, "viewpoints", {own[k]: [] for k in due if held[k]})
    at = ""
    commits: list[float] = []
    try:
        with compute.reserve_place(memory) as place, _claim_chunks(run, name, reads, writes):
            while due:
                at = f"viewpoint {due[0]}"
                session, fork = fork_store(run.store)
                fork, made = compute.submit(
                    process_viewpoints, run, fork, street, due, street_key, memory=memory, place=place
                ).result()
                records = {
                    own[k]: cast(ViewpointRecord, {**record, "unit": f"{name}/{k}", "key": keys[k], "status": "done"})
                    for k, record in zip(due, made, strict=False)
                }
                started = time.perf_counter()
                commit_units(session, fork, "viewpoints", records, f"{len(records)} viewpoints from {name}/{due[0]} on")
                commits.append(round(time.perf_counter() - started, 4))
                log_units("viewpoints", records.values())
                outcome = outcome.add(records.values())
                report_progress("viewpoints", len(records))
                due = due[len(records) :]
            if done:
                return outcome
            at = "end of the street"
            session, fork = fork_store(run.store)
            fork, result = compute.submit(
                write_street_texels, run, fork, street, len(own), street_key, memory=memory, place=place
            ).result()
            own_fields = {"unit": name, "key": street_key, "status": "done", "wave": wave, "commits": commits}
            record = cast(StreetRecord, {**result, **own_fields, "chain": found.chain})
            snapshot = commit_units(session, fork, "streets", {street: record}, f"street {name}")
    except Exception as error:
        if is_machine_fault(error):
            raise machine_error(f"street {name}", error) from error
        session, fork = fork_store(run.store)
        if done and due:  # the street's texels stand on no panorama: they stay
            failed = failure_record(f"{name}/{due[0]}", keys[due[0]], error)
            commit_units(session, fork, "viewpoints", {own[due[0]]: failed}, f"viewpoint {name}/{due[0]} failed")
            log_units("viewpoints", [failed])
            return outcome.add([failed])
        failed = failure_record(name, street_key, error)
        failed["reason"] = f"{at}: {failed['reason']}" if at else failed["reason"]
        failed = cast(StreetRecord, {**failed, "wave": wave, "digests": {}})
        commit_units(session, fork, "streets", {street: failed}, f"street {name} failed")
        clear_failed_street_texels(run, plan, street)
        log_units("streets", [failed])
        return outcome.add([failed])
    log_units("streets", [record])
    _tag_snapshot(run, street_commit_tag(record), snapshot)
    return outcome.add([record])


# Chunks that the streets under way in this process read and write, by store and street.
_under_way: dict[tuple[str, str], tuple[frozenset[str], frozenset[str]]] = {}
_claiming = Lock()


@contextmanager
def _claim_chunks(run: Run, name: str, reads: frozenset[str], writes: frozenset[str]) -> Iterator[None]:
    """Claim a street's chunks while it runs.

    Raises StoreError if a running street writes chunks that this one reads, or the reverse: forks that write one chunk merge
    without an error, and one of the writes is lost.
    """
    with _claiming:
        for (store, other), (their_reads, their_writes) in _under_way.items():
            shared = (writes & their_reads) | (their_writes & reads)
            if store == run.out and shared:
                raise StoreError(
                    f"street {name} and street {other} share {len(shared)} chunks, such as {min(shared)}, and run at the same "
                    "time; ingest the block again, which orders its streets anew"
                )
        _under_way[run.out, name] = (reads, writes)
    try:
        yield
    finally:
        with _claiming:
            del _under_way[run.out, name]


def _tag_snapshot(run: Run, tag: str, snapshot: str) -> None:
    repository = open_repository(run.store)
    if tag not in repository.list_tags():
        try:
            repository.create_tag(tag, snapshot)
        except (
            icechunk.IcechunkError
        ):  # a tag once deleted cannot be made again; the snapshot stays reachable from main
            return


def clear_failed_street_texels(run: Run, plan: Plan, street: int) -> None:
    """Clear the texels of a failed street that match no digest of another street.

    Streets that wrote there earlier are pending again, as their texels were overwritten.
    """
    session = open_repository(run.store).writable_session(BRANCH)
    group, placement = open_root(session), plan.scene.placement
    charts = plan.charts_of_street(street)
    charts = charts[plan.writable[charts]]
    others = np.setdiff1d(plan.select_street_chart_pairs(charts)[:, 0], [street])
    records = dict(zip(others.tolist(), read_records(group, "streets", others), strict=True))
    rasters = TexelLayout.of_charts(placement, charts)
    colour, views = (read_rasters(group[array.path], placement, rasters) for array in STAGE_ARRAYS["streets"])
    known = chart_digests(np.zeros_like(colour), np.zeros_like(views), placement, rasters, plan.ids)
    known |= latest_chart_digests([], list(records.values()))
    found = chart_digests(colour, views, placement, rasters, plan.ids)
    stale = {name for name, digest in found.items() if digest != known[name]}
    if not stale:
        return
    clear_rasters(
        group, plan.scene.spec, placement, [c for c in charts.tolist() if f"{plan.ids[c]:016x}" in stale], "streets"
    )
    for other, record in records.items():
        if record and not stale.isdisjoint(record["digests"]):
            clear_record(group, "streets", other)
    commit(session, f"street {plan.streets[street].id} failed: what it left is cleared")
