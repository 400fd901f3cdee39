"""Workers killed while a run starts them: others take their place."""

from __future__ import annotations

import os
import signal
from typing import Any

import distributed
import pytest

from tasks.engine.compute.connect import connect

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
