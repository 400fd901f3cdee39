"""A viewer that serves a run's folder, and what it answers."""

from __future__ import annotations

import subprocess
import sys
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.pipeline.runs import ROOT, environment


@contextmanager
def viewing(out: Path, *options: str) -> Iterator[str]:
    """The address that a viewer of a run's folder tells."""
    process = subprocess.Popen(
        [sys.executable, "-m", "flows", "view", str(out), "--port", "0", "--no-open", *options],
        cwd=ROOT,
        env=environment(out.parent),
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[0]
    finally:
        process.terminate()
        process.wait(300)


def get(address: str, **parameters: Any) -> bytes:
    query = f"?{urllib.parse.urlencode(parameters)}" if parameters else ""
    with urllib.request.urlopen(address + query, timeout=300) as answer:
        return bytes(answer.read())
