"""Workers killed while a run starts them: others take their place. Ctrl-C does not reach them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import distributed
import pytest

from tasks.engine.compute.connect import connect
from tests.pipeline.runs import PATIENCE_S, ROOT, environment

pytestmark = pytest.mark.long


@pytest.mark.parametrize("killed", [1, 2])
def test_workers_that_are_killed_while_they_are_set_up_are_replaced(
    killed: int, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    register, waiting = distributed.Client.register_plugin, [True]

    def register_and_kill(client: Any, plugin: Any, name: str) -> Any:
        if waiting:
            waiting.clear()
            for worker in list(client.cluster.workers.values())[:killed]:
                os.kill(worker.pid, signal.SIGKILL)
        return register(client, plugin, name=name)

    monkeypatch.setattr(distributed.Client, "register_plugin", register_and_kill)
    with connect(2, None, str(tmp_path)) as compute:
        assert [unit.result() for unit in [compute.submit(abs, -1), compute.submit(abs, -2)]] == [1, 2]
    assert not waiting


# A process of its own: the first cluster of a process also starts Python's resource tracker, which changes the mask.
BLOCKED = """
import json, os, sys
from pathlib import Path
import psutil
from tasks.engine.compute.connect import connect
if __name__ == "__main__":
    with connect(2, None, sys.argv[1]):
        workers = [one.pid for one in psutil.Process().children(recursive=True) if "spawn_main" in " ".join(one.cmdline())]
        states = [dict(line.split(":") for line in Path(f"/proc/{pid}/status").open()) for pid in workers]
        print(json.dumps([int(state["SigBlk"], 16) for state in states]), flush=True)
"""


# As few descriptors as the first worker needs, or fewer.
FEW_FILES = """
import os, resource, sys
import distributed
from facade_core.core.errors import MachineError
from tasks.engine.compute.connect import connect
if __name__ == "__main__":
    limit = len(os.listdir("/proc/self/fd")) + 20
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))
    try:
        with connect(2, None, sys.argv[1]):
            print("started", flush=True)
    except MachineError as error:
        print(error, flush=True)
    os._exit(0)
"""


def run_script(text: str, folder: Path) -> str:
    """Run a script in a process of its own; returns what it prints."""
    script = folder / "start.py"
    script.write_text(text)
    done = subprocess.run(
        [sys.executable, str(script), str(folder)],
        cwd=ROOT,
        env=environment(folder) | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )
    return done.stdout


def test_too_few_descriptors_are_named_with_the_remedy(tmp_path: Path) -> None:
    assert run_script(FEW_FILES, tmp_path).splitlines() == [
        "2 local workers do not start; see to the machine's memory and to its limit of open files (`ulimit -n`), or name "
        "fewer with --workers"
    ]


def test_workers_block_interrupts_from_their_first_instruction_on(tmp_path: Path) -> None:
    masks = json.loads(run_script(BLOCKED, tmp_path))
    assert len(masks) == 2
    assert all(mask >> (signal.SIGINT - 1) & 1 for mask in masks)
