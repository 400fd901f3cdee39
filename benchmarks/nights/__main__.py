"""Nights of a Prefect deployment: its messages and alarms, the units of each night, and the growth of the disk.

A small block is deployed with `prefect deploy -n city-block/nightly`, as deploy/README.md says, on a server, a worker and a
database of their own on loopback. Their clock is set forward from one night to the next.

    python -m benchmarks.nights OUT
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.nights.clock import ShiftedClock, shift_clock
from benchmarks.nights.report import NightStart, measure_folder_mb
from benchmarks.same_bytes import check_out
from deploy.rehearsal.postgres import postgres
from facade_core.core.errors import StoreError
from flows.server.startup import find_free_port
from tasks.engine.store.commits import read_newest_journal
from tests.pipeline.deployed import (
    Site,
    automate,
    end,
    healthy,
    kill,
    left_running,
    listening,
    new_site,
    notified_at,
    runs,
    typed,
    until,
)
from tests.pipeline.runs import working_in
from tests.pipeline.stages import write_block, write_photo

if TYPE_CHECKING:
    from uuid import UUID

    from prefect.client.schemas.objects import FlowRun

WORKER = "prefect worker start --type process --pool streetloom"
DEPLOY = """prefect deploy -n city-block/nightly --param block_file='"blocks/mine.yaml"' --param out='"out/mine"'"""
KEEP = 2
# Seconds in which the server notices that its clock was set forward.
SETTLE_S = 6
# Hours after a failed night in which alarms are awaited: the last good run is then more than 26 hours past.
HOURS_WATCHED = 5
FIRST_PHOTO, NEW_PHOTO = "a-0", "c-0"
# The change of the new version: every surface has another colour.
SURFACES = Path("tasks/stages/surfaces/worker.py")
CHANGED_LINE = ("= rgb.reshape(-1, 3),", "= (rgb | 1).reshape(-1, 3),")


@dataclass
class Operation:
    """Deployment of a block whose nights are measured."""

    folder: Path
    site: Site
    clock: ShiftedClock
    block: Path
    alarms: list[tuple[datetime, dict[str, str]]]
    seen: set[UUID] = field(default_factory=set)
    nights: list[dict[str, Any]] = field(default_factory=list)

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def pass_night(self, what: str, meanwhile: Callable[[], None] | None = None, *, fails: bool = False) -> None:
        """Wait for the scheduled run of the next night, and report it.

        Parameters
        ----------
        what : event of the night.
        meanwhile : called when the run has begun.
        fails : whether the hours of the morning pass one by one, to see when alarms come.
        """
        before = NightStart(self.out, self.site.home, len(self.alarms))
        self.clock.advance_to(next_two_oclock(self.clock.now()) - timedelta(seconds=40))
        run = until(self._find_new_run, self.site)
        assert run
        if meanwhile is not None:
            meanwhile()
            while not self._read(run.id).end_time:  # until the server misses the run
                self._advance(timedelta(minutes=4))
        until(lambda: self._read(run.id).end_time, self.site)
        until(lambda: not working_in(self.out), self.site)
        self._advance(timedelta(minutes=1))
        for _ in range(HOURS_WATCHED if fails else 0):
            self._advance(timedelta(hours=1))
        database = measure_folder_mb(self.folder / "postgres" / "data" / "base")
        night = {"what": what} | before.describe_night(self.site, self._read(run.id), self.alarms)
        self.nights.append(night | {"database_mb": database})
        print(json.dumps(self.nights[-1], indent=1), file=sys.stderr)

    def lose_worker(self, facade: str) -> None:
        """Kill the worker and its run once a facade is committed, and start a new worker."""
        before = self._started(facade)
        until(lambda: self._started(facade) not in (None, before), self.site)
        kill(self.site, WORKER)
        left_running(self.site, WORKER, "worker2.log")

    def _advance(self, by: timedelta) -> None:
        self.clock.advance_to(self.clock.now() + by)
        time.sleep(SETTLE_S)

    def _find_new_run(self) -> FlowRun | None:
        new = [run for run in runs(self.site, "nightly") if run.id not in self.seen]
        self.seen |= {run.id for run in new}
        return new[0] if new else None

    def _read(self, run: UUID) -> FlowRun:
        with self.site.client() as client:
            return client.read_flow_run(run)

    def _started(self, facade: str) -> float | None:
        """Return when a facade was begun whose record is committed."""
        try:
            records = read_newest_journal(self.out / "store", "facades")
        except (StoreError, KeyError, FileNotFoundError):
            return None
        return next((record["started"] for record in records if record and record["unit"] == facade), None)


def measure(folder: Path) -> dict[str, Any]:
    """Pass six nights and return their reports."""
    checkout = folder / "streetloom"
    checkout.mkdir(parents=True)
    check_out("HEAD", checkout)
    write_photo(folder / "in", FIRST_PHOTO, 1)
    block = write_block(folder / "in")
    buildings = block.with_name("buildings.geojson")
    whole_map = buildings.read_bytes()
    alarms: list[tuple[datetime, dict[str, str]]] = []
    with (
        shift_clock(folder) as clock,
        postgres(folder / "postgres", "127.0.0.1", find_free_port()) as database,
        listening(lambda body: alarms.append((clock.now(), json.loads(body)))) as webhook,
    ):
        site = new_site(folder / "prefect", database, checkout)
        site.environment["PYTHONPATH"] = str(checkout)
        operation = Operation(folder, site, clock, block, alarms)
        try:
            _deploy(operation, webhook)
            operation.pass_night("the first: everything is done")
            buildings.write_bytes(whole_map[: len(whole_map) // 2])
            operation.pass_night("the map is cut off", fails=True)
            buildings.write_bytes(whole_map)
            write_photo(folder / "in", NEW_PHOTO, 1)
            operation.pass_night(
                "a new photo; worker and run are killed", lambda: operation.lose_worker(NEW_PHOTO), fails=True
            )
            operation.pass_night("what the killed run left is done")
            _change_code(checkout)
            operation.pass_night("a new version that colours every surface otherwise")
            operation.pass_night("nothing new")
        finally:
            left = end(site)
    return {"keep": KEEP, "nights": operation.nights, "processes_left": len(left)}


def _deploy(operation: Operation, webhook: str) -> None:
    site = operation.site
    left_running(site, "prefect server start", "server.log")
    until(lambda: healthy(site), site)
    typed(site, "prefect work-pool create streetloom --type process")
    own = {"blocks/mine.yaml": str(operation.block), '"out/mine"\'': f'"{operation.out}"\' --param keep={KEEP}'}
    typed(site, DEPLOY, own)
    notified_at(site, webhook)
    automate(site, site.root / "deploy" / "automations.yaml")
    left_running(site, WORKER, "worker.log")


def _change_code(checkout: Path) -> None:
    path = checkout / SURFACES
    text = path.read_text()
    assert text.count(CHANGED_LINE[0]) == 1
    path.write_text(text.replace(*CHANGED_LINE))


def next_two_oclock(now: datetime) -> datetime:
    """Return when the schedule fires next."""
    today = now.replace(hour=2, minute=0, second=0, microsecond=0)
    return today if today > now else today + timedelta(days=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="a new folder for the block, its results and the server's data")
    folder = parser.parse_args().out.resolve()
    if folder.exists():
        parser.error(f"{folder}: exists; name a new folder")
    print(json.dumps(measure(folder), indent=2))


if __name__ == "__main__":
    main()
