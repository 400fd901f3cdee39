"""Workers of another make beside those of this one, and workers that speak TLS."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import dask
import pytest
from distributed import Client, LocalCluster
from distributed.security import Security

from facade_core.core.errors import InputError
from tasks.engine.compute.cluster import Timeouts
from tasks.engine.compute.connect import connect, require_scheduler
from tasks.engine.stage_code import VERSION
from tests.pipeline.runs import ROOT

pytestmark = pytest.mark.long

HERE = {"host": "127.0.0.1", "dashboard_address": None, "threads_per_worker": 1}


def pid() -> int:
    return os.getpid()


STRANGER = """
import sys
import tasks.engine.stage_code
tasks.engine.stage_code.code_version = lambda coded: "another"
from distributed.cli.dask_worker import main
main(sys.argv[1:])
"""


def test_a_worker_of_another_make_is_left_out_from_the_start(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with LocalCluster(n_workers=1, **HERE) as there, Client(there) as client:
        options = ["--no-nanny", "--no-dashboard", "--nthreads", "4", "--name", "stranger"]
        stranger = subprocess.Popen(
            [sys.executable, "-c", STRANGER, there.scheduler_address, *options], cwd=ROOT, stderr=subprocess.DEVNULL
        )
        try:
            client.wait_for_workers(2, timeout=300)
            with (
                caplog.at_level(logging.WARNING, "tasks"),
                connect(1, there.scheduler_address, str(tmp_path)) as compute,
            ):
                ran = {unit.result() for unit in [compute.submit(pid) for _ in range(12)]}
            stranger.wait(300)  # it closes, so that whoever starts it anew has the new code
        finally:
            stranger.kill()
            stranger.wait()
    assert len(ran) == 1
    assert stranger.pid not in ran
    (said,) = [record.getMessage() for record in caplog.records if "it is not used" in record.getMessage()]
    assert "worker stranger at" in said
    assert f"has Streetloom another and this run {VERSION}+" in said


@pytest.fixture
def secured(tmp_path: Path) -> dict[str, str]:
    """Dask's own settings for TLS, by files, as a deployment has them."""
    security = Security.temporary()
    files = {}
    for name in ("tls_ca_file", "tls_client_cert", "tls_client_key"):
        (tmp_path / name).write_text(getattr(security, name))
        files[name] = str(tmp_path / name)
    settings = {"distributed.comm.require-encryption": True, "distributed.comm.tls.ca-file": files["tls_ca_file"]}
    for role in ("scheduler", "worker", "client"):
        settings[f"distributed.comm.tls.{role}.cert"] = files["tls_client_cert"]
        settings[f"distributed.comm.tls.{role}.key"] = files["tls_client_key"]
    return settings


def test_units_run_through_tls(tmp_path: Path, secured: dict[str, str]) -> None:
    with dask.config.set(secured), LocalCluster(n_workers=1, security=Security(), **HERE) as there:
        assert there.scheduler_address.startswith("tls://")
        with connect(1, there.scheduler_address, str(tmp_path)) as compute:
            assert compute.submit(pid).result() != os.getpid()
        address = there.scheduler_address
        with (
            dask.config.set({name: None for name in secured}),
            pytest.raises(InputError, match="a certificate is needed"),
        ):
            require_scheduler(address, Timeouts().connect)
