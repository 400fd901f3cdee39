"""Texture one street, viewpoint by viewpoint, in order."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from threading import Lock

import icechunk
import numpy as np
import zarr
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.features import file_stem
from facade_core.atlas.journal import (
    forget_record,
    read_journal,
    read_records,
    unit_key,
    write_record,
)
from facade_core.atlas.store import BRANCH, commit, open_repository
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.errors import InputError, StoreError
from facade_core.ingest import Plan
from tasks.carry import forget_units
from tasks.cluster import ClusterGone
from tasks.commits import begin, finish
from tasks.compute import Compute
from tasks.outcome import Outcome, failure, is_done
from tasks.plan import plan_of_run
from tasks.progress import advance
from tasks.run import Run
from tasks.street_keys import street_keys
from tasks.units.viewpoint import street_unit, viewpoint_unit


@task(name="street", task_run_name="street {title}", cache_policy=NO_CACHE)
def texture_street(run: Run, street: int, title: str, memory: int, compute: Compute) -> Outcome:
    """Every viewpoint not yet journalled, one commit each, then the street's texels in one commit, tagged.

    One worker keeps the street's state of `memory` bytes; where it is lost, another rebuilds that from the panoramas.
    """
    with compute.lease(memory) as worker:
        return _texture(run, street, compute, worker)


def _texture(run: Run, street: int, compute: Compute, worker: str) -> Outcome:
    plan = plan_of_run(run)
    session = open_repository(run.store).readonly_session(BRANCH)
    group: StoreGroup = zarr.open_group(session.store, mode="r")
    wave, name = int(plan.wave[street]), plan.streets[street].id
    own = [v.id for v in plan.of_street(street)]
    reads, writes = street_chunks(plan, street)
    found = street_keys(run, plan, group, street)
    street_key, keys = found.street, found.viewpoints
    if is_done(read_records(group, "streets", np.array([street]))[0], street_key):
        advance("viewpoints", len(own))
        return Outcome(skipped=len(own) + 1)
    held = read_records(group, "viewpoints", np.array(own, np.int64))
    first = next((k for k in range(len(own)) if not is_done(held[k], keys[k])), len(own))
    # who reads them later must not take them for what this street shows now
    forget_units(run, plan, "viewpoints", {own[k]: [] for k in range(first, len(own)) if held[k]})
    outcome = Outcome(skipped=first)
    advance("viewpoints", first)
    step = first
    commits: list[float] = []
    try:
        with _claimed(run, name, reads, writes):
            for step in range(first, len(own)):
                session, fork = begin(run.store)
                fork, record = compute.submit(
                    viewpoint_unit, run, fork, street, step, street_key, worker=worker
                ).result()
                record |= {"unit": f"{name}/{step}", "key": keys[step], "status": "done"}
                started = time.perf_counter()
                finish(session, fork, "viewpoints", {own[step]: record}, f"viewpoint {name}/{step}")
                commits.append(round(time.perf_counter() - started, 4))
                outcome = outcome.add([record])
                advance("viewpoints", 1)
            session, fork = begin(run.store)
            fork, record = compute.submit(street_unit, run, fork, street, len(own), street_key, worker=worker).result()
            record |= {"unit": name, "key": street_key, "status": "done", "wave": wave, "commits": commits}
            snapshot = finish(session, fork, "streets", {street: record}, f"street {name}")
    except ClusterGone:
        raise
    except Exception as error:
        session, fork = begin(run.store)
        record = failure(name, street_key, error) | {"wave": wave, "digests": {}}
        record["reason"] = f"viewpoint {step}: {record['reason']}"
        finish(session, fork, "streets", {street: record}, f"street {name} failed")
        return outcome.add([record])
    _tag(run, f"street-{file_stem(name)}-{unit_key(street_key)[:12]}", snapshot)
    return outcome.add([record])


@dataclass(frozen=True)
class Redo:
    """Streets to do again, and those of later waves that read what they write, by index, in the order of their waves."""

    streets: tuple[int, ...]
    dependants: tuple[int, ...]


def redo_street(run: Run, street: str, *, only: bool) -> tuple[list[str], list[str]]:
    """Forget what the journal holds of a street, given by id or name, and of its dependants; with `only` these keep their
    texels and are marked stale, which the next run mends. Returns the ids of both.

    Raises InputError for an unknown street, and where everything is due anyway.
    """
    session = open_repository(run.store).writable_session(BRANCH)
    group: StoreGroup = zarr.open_group(session.store)
    if group.attrs.get("key") != run.key:
        raise InputError(f"{run.out}: its inputs or the code changed since it was made; run it without --redo first")
    plan = plan_of_run(run)
    found = find_redo(plan, street)
    names = [[plan.streets[index].id for index in indices] for indices in (found.streets, found.dependants)]
    records = read_journal(group, "streets")
    for index in (*found.streets, *found.dependants):
        record = records[index]
        if index in found.streets or not only:
            forget_record(group, "streets", index)
            for viewpoint in plan.of_street(index):
                forget_record(group, "viewpoints", viewpoint.id)
        elif record and record["status"] == "done":
            reason = f"street {' and '.join(names[0])} was done again without it; run the block to bring it up to date"
            write_record(group, "streets", index, record | {"status": "stale", "reason": reason})
    commit(session, f"redo {', '.join(names[0])}")
    return names[0], names[1]


def find_redo(plan: Plan, street: str) -> Redo:
    """The streets of an id or name, and whoever reads what they write. Raises InputError where there is none."""
    chosen = [i for i, one in enumerate(plan.streets) if street in (one.id, one.name)]
    if not chosen:
        known = sorted({one.name or one.id for one in plan.streets})
        near = get_close_matches(street, known, n=1, cutoff=0.4) or known[:1]
        raise InputError(f"no street has the id or name {street!r}; there is {near[0]!r} among {len(known)}")
    reads, writes = zip(*(street_chunks(plan, i) for i in range(len(plan.streets))), strict=True)
    changed = frozenset().union(*(writes[i] for i in chosen))
    dependants = []
    for index in sorted(range(len(plan.streets)), key=lambda i: (int(plan.wave[i]), i)):
        if index not in chosen and plan.wave[index] > min(plan.wave[chosen]) and reads[index] & changed:
            dependants.append(index)
            changed |= writes[index]
    return Redo(tuple(sorted(chosen, key=lambda i: int(plan.wave[i]))), tuple(dependants))


def chosen_streets(run: Run, only: str | None) -> frozenset[int] | None:
    """The streets to texture where only some are wanted; None for all."""
    return None if only is None else frozenset(find_redo(plan_of_run(run), only).streets)


def street_chunks(plan: Plan, street: int) -> tuple[frozenset[str], frozenset[str]]:
    """The chunks that a street reads, and those of them that it writes, as "page/row/column"."""
    charts = plan.street_charts[plan.street_charts[:, 0] == street, 1]
    spec, placement = plan.scene.spec, plan.scene.placement
    reads, writes = set(), set()
    for chart in charts.tolist():
        cells = {"/".join(map(str, cell)) for cell in placement.chunks(chart, spec.chunk, spec.gutter).tolist()}
        reads |= cells
        if plan.writable[chart]:
            writes |= cells
    return frozenset(reads), frozenset(writes)


# Chunks that the streets under way in this process read and write, by store and street.
_under_way: dict[tuple[str, str], tuple[frozenset[str], frozenset[str]]] = {}
_claiming = Lock()


@contextmanager
def _claimed(run: Run, name: str, reads: frozenset[str], writes: frozenset[str]) -> Iterator[None]:
    """Hold a street's chunks while it runs.

    Raises StoreError where a street under way writes what this one reads, or the other way round: forks that write one chunk
    merge without an error, and one of the writes is lost.
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


def _tag(run: Run, tag: str, snapshot: str) -> None:
    repository = open_repository(run.store)
    if tag not in repository.list_tags():
        try:
            repository.create_tag(tag, snapshot)
        except (
            icechunk.IcechunkError
        ):  # a tag once deleted cannot be made again; the snapshot stays reachable from main
            return
