"""Prefect as its user runs it: a server, a worker and a webhook of their own, and the lines of deploy/README.md typed into a
shell."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar
from urllib.error import URLError
from urllib.request import urlopen

import psutil
import yaml

from flows.server.startup import TELEMETRY_OFF, find_free_port
from tests.pipeline.runs import PATIENCE_S, ROOT, environment

if TYPE_CHECKING:
    from prefect.client.orchestration import SyncPrefectClient
    from prefect.client.schemas.objects import FlowRun

README = (ROOT / "deploy" / "README.md").read_text()

T = TypeVar("T")


@dataclass(frozen=True)
class Site:
    """A Prefect of its own: `home` holds its data and logs; commands are typed in the folder `root`, in `environment`."""

    home: Path
    environment: dict[str, str]
    root: Path = ROOT
    started: list[subprocess.Popen] = field(default_factory=list)

    @property
    def api(self) -> str:
        return self.environment["PREFECT_API_URL"]

    def client(self) -> SyncPrefectClient:
        from prefect.client.orchestration import SyncPrefectClient

        return SyncPrefectClient(self.api)


def new_site(home: Path, database: str | None = None, root: Path = ROOT) -> Site:
    """Nothing runs yet; the port is free now.

    database: the address of one, SQLite's in the home where it is None; root: the clone whose code runs.
    """
    port = str(find_free_port())
    own = {
        "PREFECT_HOME": str(home),
        "PREFECT_SERVER_API_PORT": port,
        "PREFECT_API_URL": f"http://127.0.0.1:{port}/api",
        "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
        "PREFECT_SERVER_CONCURRENCY_INITIAL_DEPLOYMENT_LEASE_DURATION": "30",
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "COLUMNS": "200",
    }
    if database:
        own["PREFECT_SERVER_DATABASE_CONNECTION_URL"] = database
    home.mkdir(parents=True)
    return Site(home, environment(home) | TELEMETRY_OFF | own, root)


def words(line: str, replaced: dict[str, str]) -> list[str]:
    """The words of a line that deploy/README.md gives, with names of its examples replaced by the test's own."""
    given = [known.split("  #")[0].strip() for known in README.splitlines()]
    assert line in given, f"not in deploy/README.md: {line}"
    for example, own in replaced.items():
        assert example in line
        line = line.replace(example, own)
    return shlex.split(line)


def typed(site: Site, line: str, replaced: dict[str, str] | None = None, expect: int = 0) -> str:
    """Type a line in the project's root and wait for it; returns what it printed."""
    done = subprocess.run(
        words(line, replaced or {}),
        cwd=site.root,
        env=site.environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == expect, done.stdout[-3000:] + done.stderr[-3000:] + _logs(site)
    return done.stdout


def left_running(site: Site, line: str, log: str, replaced: dict[str, str] | None = None) -> subprocess.Popen:
    """Type a line and leave it running, as in a terminal of its own."""
    with (site.home / log).open("wb") as output:
        process = subprocess.Popen(
            words(line, replaced or {}),
            cwd=site.root,
            env=site.environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=_heed_interrupts,
        )
    site.started.append(process)
    return process


def _heed_interrupts() -> None:
    """As a terminal's commands do; those of a background job inherit that an interrupt is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def until(asked: Callable[[], T], site: Site, seconds: float = PATIENCE_S) -> T:
    """What `asked` answers once that is true; fails with the logs when it takes longer than `seconds`."""
    deadline = time.monotonic() + seconds
    while not (answer := asked()):
        assert time.monotonic() < deadline, _logs(site)
        time.sleep(0.5)
    return answer


def healthy(site: Site) -> bool:
    try:
        with urlopen(f"{site.api}/health", timeout=30):
            return True
    except (URLError, OSError):
        return False


def running(site: Site) -> list[psutil.Process]:
    """Every process that was started with this site's environment, by whomever."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("PREFECT_HOME") == str(site.home) and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue
    return found


def kill(site: Site, command: str) -> None:
    """SIGKILL what was left running by a command and everything it started, all at once."""
    process = next(one for one in site.started if one.args[1:3] == command.split()[1:3])
    site.started.remove(process)
    whole = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    for one in whole:
        one.kill()
    process.wait()


def end(site: Site) -> list[psutil.Process]:
    """End what was left running, the last first, as Ctrl-C does; returns what is still there a while after."""
    for process in reversed(site.started):
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    deadline = time.monotonic() + PATIENCE_S
    while (left := running(site)) and time.monotonic() < deadline:
        time.sleep(0.2)
    for process in left:
        process.kill()
    return left


def runs(site: Site, deployment: str, scheduled: bool = False) -> list[FlowRun]:
    """The runs of a deployment, the newest first: those that are only scheduled, or the others."""
    from prefect.client.schemas.filters import DeploymentFilter, DeploymentFilterName
    from prefect.client.schemas.sorting import FlowRunSort

    with site.client() as client:
        found = client.read_flow_runs(
            deployment_filter=DeploymentFilter(name=DeploymentFilterName(any_=[deployment])),
            sort=FlowRunSort.EXPECTED_START_TIME_DESC,
        )
    return [run for run in found if (run.state_name in ("Scheduled", "Late")) == scheduled]


def notified_at(site: Site, address: str) -> None:
    """Make the block `custom-webhook/team`, which tells a webhook."""
    block = (
        f"from prefect.blocks.notifications import CustomWebhookNotificationBlock as To; To(name='team', url={address!r}, "
        "json_data={'subject': '{{subject}}', 'body': '{{body}}'}).save('team', overwrite=True)"
    )
    subprocess.run([sys.executable, "-c", block], env=site.environment, check=True)


def automate(site: Site, file: Path) -> None:
    done = subprocess.run(
        [sys.executable, "deploy/automations.py", str(file), "--notify", "custom-webhook/team"],
        cwd=ROOT,
        env=site.environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    with site.client() as client:
        made = [one.name for one in client.read_automations()]
    assert sorted(made) == sorted(one["name"] for one in yaml.safe_load(file.read_text()))


@contextmanager
def listening(tell: Callable[[str], object]) -> Iterator[str]:
    """Yield the address of a webhook that passes each notification to a function."""

    class Webhook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            tell(self.rfile.read(int(self.headers["Content-Length"])).decode())
            self.send_response(200)
            self.end_headers()

    with ThreadingHTTPServer(("127.0.0.1", 0), Webhook) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def _logs(site: Site) -> str:
    return "".join(f"\n--- {log.name}\n{log.read_text()[-3000:]}" for log in sorted(site.home.glob("*.log")))
