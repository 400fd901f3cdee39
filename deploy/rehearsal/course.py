"""What happens in a rehearsal, in order; run by `python -m deploy.rehearsal` where namespaces can be made."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import click

from deploy import certificates
from deploy.rehearsal.namespaces import Namespaces, follow
from deploy.rehearsal.postgres import postgres
from deploy.rehearsal.town import write_town

ROOT = Path(__file__).resolve().parents[2]
WORKERS = ("worker1", "worker2", "worker3")
PATIENCE_S = 600.0
# What of the code workers run; the second version of it has a line more that changes nothing.
CODE = ("facade_core", "catalogs", "tasks", "flows")
CHANGED, LINE = "tasks/stages/facades/worker.py", "\nSECOND_VERSION = True\n"


@dataclass
class Parts:
    """What deploy/compose.yaml has, each on a machine of its own. secure: the environment of Dask's parts."""

    folder: Path
    net: Namespaces
    secure: Mapping[str, str] = field(default_factory=dict)
    begun: float = field(default_factory=time.monotonic)

    def tell(self, line: str) -> None:
        click.echo(f"[{time.monotonic() - self.begun:6.1f} s] {line}")

    @property
    def scheduler_address(self) -> str:
        return f"tls://{self.net.addresses['scheduler']}:8786"

    def environment(self, code: Path = ROOT) -> dict[str, str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT_", "DASK_", "AWS_"))}
        server, s3 = self.net.addresses["server"], self.net.addresses["s3"]
        return {
            **kept,
            **self.secure,
            "PYTHONPATH": str(code),
            "HOME": str(self.folder / "home"),
            "PREFECT_API_URL": f"http://{server}:4200/api",
            "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
            "DO_NOT_TRACK": "1",
            "AWS_ENDPOINT_URL": f"http://{s3}:9000",
            "AWS_ACCESS_KEY_ID": "rehearsal",
            "AWS_SECRET_ACCESS_KEY": "rehearsal",
            "AWS_REGION": "us-east-1",
            "AWS_EC2_METADATA_DISABLED": "true",
        }

    def scheduler(self) -> None:
        here = ["--host", self.net.addresses["scheduler"], "--port", "8786", "--protocol", "tls"]
        command = [sys.executable, "-m", "dask", "scheduler", *here, "--dashboard-address", ":8787"]
        self.net.start("scheduler", "scheduler", command, self.environment(), self.folder)
        self.until(lambda: listens(self.net.addresses["scheduler"], 8786), "the scheduler listens")

    def worker(self, name: str, code: Path = ROOT) -> None:
        options = ["--nthreads", "1", "--memory-limit", "2GB", "--name", name, "--host", self.net.addresses[name]]
        local = ["--local-directory", str(self.folder / "scratch" / name), "--dashboard-address", ":8790"]
        command = [sys.executable, "-m", "dask", "worker", self.scheduler_address, *options, *local]
        self.net.start(name, name, command, self.environment(code), code)

    def restart(self) -> None:
        """Start anew what ended, as an orchestrator does."""
        for name, start in (("scheduler", self.scheduler), *((w, lambda w=w: self.worker(w)) for w in WORKERS)):
            process = self.net.processes.get(name)
            if process is None or process.poll() is not None:
                self.net.processes.pop(name, None)
                start()

    def city(self, town: Path, out: Path, *options: str) -> subprocess.Popen:
        asked = ["city", str(town), "--out", str(out), "--json", *options]
        with (self.net.logs / "city.log").open("ab") as log:
            return subprocess.Popen(
                [*self.net.within("run"), sys.executable, "-m", "flows", *asked],
                cwd=ROOT,
                env=self.environment(),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                preexec_fn=follow,
            )

    def until(self, asked: Callable[[], Any], what: str, seconds: float = PATIENCE_S) -> None:
        deadline = time.monotonic() + seconds
        while not asked():
            if time.monotonic() > deadline:
                raise click.ClickException(f"waited in vain until {what}; see {self.net.logs}")
            time.sleep(0.25)

    def said(self, name: str) -> str:
        log = self.net.logs / f"{name}.log"
        return log.read_text(errors="replace") if log.exists() else ""


def listens(address: str, port: int) -> bool:
    """Whether somebody takes a connection there."""
    try:
        socket.create_connection((address, port), timeout=5).close()
    except OSError:
        return False
    return True


def answers(url: str, body: Mapping[str, Any] | None = None) -> Any:
    """What is answered there; None where nobody does."""
    data = None if body is None else json.dumps(body).encode()
    try:
        with urlopen(Request(url, data, {"Content-Type": "application/json"}), timeout=5) as answer:
            return json.loads(answer.read() or b"true")
    except (OSError, ValueError):
        return None


def start(parts: Parts) -> None:
    """All parts, each when what it needs is there."""
    net = parts.net
    for name in ("server", "s3", "scheduler", "run", *WORKERS):
        net.machine(name)
    (parts.folder / "home").mkdir()
    certificates.make(parts.folder / "tls")
    parts.secure = certificates.settings(parts.folder / "tls")
    server, s3 = net.addresses["server"], net.addresses["s3"]
    database = net.ends.enter_context(postgres(parts.folder / "postgres", server, 5432, net.within("server")))
    prefect = [str(Path(sys.executable).parent / "prefect"), "server", "start", "--host", server, "--port", "4200"]
    own = {"PREFECT_SERVER_DATABASE_CONNECTION_URL": database, "PREFECT_HOME": str(parts.folder / "prefect")}
    net.start("server", "prefect", prefect, parts.environment() | own, parts.folder)
    net.start(
        "s3", "s3", [sys.executable, "-m", "moto.server", "-H", s3, "-p", "9000"], parts.environment(), parts.folder
    )
    parts.scheduler()
    for name in WORKERS:
        parts.worker(name)
    parts.until(lambda: answers(f"http://{server}:4200/api/health"), "Prefect's server answers")
    parts.tell(f"{len(net.addresses)} machines: Prefect on PostgreSQL, S3, a scheduler, {len(WORKERS)} workers, TLS")


def second_version(folder: Path) -> Path:
    """A copy of the code that computes the same by other code."""
    for name in CODE:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    with (folder / CHANGED).open("a") as module:
        module.write(LINE)
    return folder


def disturb(parts: Parts, city: subprocess.Popen, out: Path, cut_s: float) -> None:
    """All that is to happen while the city is at work, the last of which ends it."""
    net = parts.net

    def at_work() -> bool:
        if city.poll() is not None:
            raise click.ClickException(f"the city ended before everything had happened to it; see {net.logs}")
        return bool(list(out.glob("blocks/*/store")))

    parts.until(at_work, "a block is at work")
    net.cut("worker1")
    cut = time.monotonic()
    parts.tell("worker1 is cut off")
    net.kill("worker2")
    parts.tell("worker2 is killed")
    parts.worker("worker2")
    net.end("worker3")
    parts.worker("worker3", second_version(parts.folder / "second"))
    parts.tell("worker3 is started anew with a second version of the code")
    parts.until(lambda: at_work() and "it is not used" in parts.said("worker3"), "worker3 is refused")
    parts.until(lambda: at_work() and net.processes["worker3"].poll() is not None, "worker3 ends")
    parts.tell(
        next(line for line in parts.said("worker3").splitlines() if "it is not used" in line).partition(" - ")[2]
    )
    net.processes.pop("worker3")
    parts.worker("worker3")
    parts.until(lambda: at_work() and time.monotonic() > cut + cut_s, "worker1 was away for long enough")
    net.heal("worker1")
    parts.tell(f"worker1 is back after {time.monotonic() - cut:.0f} s")
    at_work()
    net.kill("scheduler")
    parts.tell("the scheduler is killed")
    city.communicate(timeout=PATIENCE_S)
    last = [line for line in parts.said("city").strip().splitlines() if line]
    parts.tell(f"the city ends with {city.returncode}: {last[-1] if last else ''}")
    if city.returncode == 0:
        raise click.ClickException("the city ended well without its scheduler")


def finished(city: subprocess.Popen, parts: Parts) -> dict[str, Any]:
    said, _ = city.communicate(timeout=PATIENCE_S * 2)
    if city.returncode:
        raise click.ClickException(f"the city ended with {city.returncode}: {parts.said('city')[-500:]}")
    return json.loads(said.strip().splitlines()[-1])


def in_bucket(parts: Parts, block: Path) -> dict[str, Any]:
    """A block whose store and published files are in a bucket from its first commit on: workers share no folder of results."""
    make = (
        "import os; from pyarrow.fs import S3FileSystem as To; at = os.environ['AWS_ENDPOINT_URL']; "
        "To(endpoint_override=at, allow_bucket_creation=True, request_timeout=60).create_dir('town')"
    )
    run = ["-m", "flows", "run", str(block), "--out", "s3://town/block", "--dask", parts.scheduler_address, "--json"]
    for command in (["-c", make], run):
        done = subprocess.run(
            [*parts.net.within("run"), sys.executable, *command],
            cwd=ROOT,
            env=parts.environment(),
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
        if done.returncode:
            raise click.ClickException(f"{command[-1]}: {done.stderr[-500:]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--blocks", default=4)
@click.option("--cut", "cut_s", default=60.0)
@click.option("--bucket/--no-bucket", default=True)
def main(folder: Path, blocks: int, cut_s: float, bucket: bool) -> None:
    """Run the course in FOLDER; exits with 1 where the end is not that of an undisturbed run."""
    follow(signal.SIGTERM)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    with Namespaces(folder / "logs") as net:
        parts = Parts(folder, net)
        start(parts)
        town, out = write_town(folder / "town", blocks), folder / "out"
        disturb(parts, parts.city(town, out, "--dask", parts.scheduler_address), out, cut_s)
        parts.restart()
        parts.tell("the scheduler and what went with it are started anew, and the city is run again")
        disturbed = finished(parts.city(town, out, "--dask", parts.scheduler_address), parts)
        parts.tell(f"the city is done: {disturbed['blocks_done']} blocks, {disturbed['facades_done']} facades")
        parts.until(lambda: answers(f"http://{net.addresses['server']}:4200/api/health"), "Prefect's server answers")
        runs = answers(f"http://{net.addresses['server']}:4200/api/flow_runs/count", {})
        parts.tell(f"Prefect has a record of {runs} runs")
        alone = finished(parts.city(town, folder / "alone", "--workers", "1"), parts)
        same = alone["atlas_digest"] == disturbed["atlas_digest"]
        parts.tell(f"undisturbed, in one process: {alone['atlas_digest']}; disturbed: {disturbed['atlas_digest']}")
        result = {"same": same, "blocks": blocks, "facades": disturbed["facades_done"], "runs": runs}
        if bucket:
            first = min((folder / "alone" / "input").glob("*.yaml"))
            digest = in_bucket(parts, first)["atlas_digest"]
            ended = folder / "alone" / "blocks" / first.stem / "ended.json"
            known = json.loads(ended.read_text())["summary"]
            result["same_in_bucket"] = digest == known["atlas_digest"]
            parts.tell(f"block {first.stem} in a bucket: {digest}; in the folder: {known['atlas_digest']}")
        click.echo(json.dumps(result | {"seconds": round(time.monotonic() - parts.begun, 1)}))
    sys.exit(0 if same and result.get("same_in_bucket", True) else 1)


if __name__ == "__main__":
    main()
