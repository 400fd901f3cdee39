"""Prometheus metrics of runs, computed from their journals, also while a run is at work.

This is their only definition; `tasks.otlp` sends the same to a collector.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import icechunk
from prometheus_client import CollectorRegistry, Gauge
from zarr.errors import GroupNotFoundError

from catalogs.published.folders import Folder, file_sizes
from catalogs.published.snapshot import find_current_snapshot
from catalogs.reader_errors import to_single_line
from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import StoreError
from tasks.stages.order import STAGE_NAMES

# Final states of a unit.
UNIT_STATES = ("done", "failed", "stale")


def collect_metrics(runs: Mapping[str, Folder]) -> tuple[CollectorRegistry, list[str]]:
    """Compute the metrics of runs, labelled by the given names; also a line for each run that cannot be read."""
    registry = CollectorRegistry()
    units = Gauge("streetloom_units", "Units in the journal.", ["run", "stage", "state"], registry=registry)
    seconds = Gauge(
        "streetloom_unit_seconds", "Seconds of workers that units took.", ["run", "stage"], registry=registry
    )
    latest = Gauge("streetloom_unit_latest", "When the newest unit was begun, Unix time.", ["run"], registry=registry)
    commits = Gauge("streetloom_snapshots", "Commits that the store keeps.", ["run"], registry=registry)
    store_bytes = Gauge("streetloom_store_bytes", "Bytes of the store.", ["run"], registry=registry)
    current = Gauge("streetloom_published", "Whether something is published.", ["run"], registry=registry)
    left_out = []
    for name, folder in runs.items():
        try:
            repository = open_repository(folder / "store")
            root = open_root(repository.readonly_session(BRANCH))
        except GroupNotFoundError:
            left_out.append(f"{name} is left out: its first commit is not there yet")
            continue
        except (StoreError, icechunk.IcechunkError) as error:
            left_out.append(f"{name} is left out: {to_single_line(str(error))}")
            continue
        begun = [0.0]
        for stage in STAGE_NAMES:
            records = [record for record in read_journal(root, stage) if record]
            counts = Counter(record["status"] for record in records)
            for state in sorted({*UNIT_STATES, *counts}):  # alarms need a series from zero on
                units.labels(name, stage, state).set(counts[state])
            seconds.labels(name, stage).set(sum(sum(record.get("seconds", {}).values()) for record in records))
            begun += [record["started"] for record in records if record.get("started")]
        latest.labels(name).set(max(begun))
        commits.labels(name).set(sum(1 for _ in repository.ancestry(branch=BRANCH)))
        store_bytes.labels(name).set(sum(file_sizes(folder / "store").values()))
        current.labels(name).set(find_current_snapshot(folder) is not None)
    return registry, left_out
