"""The same style library for one and two processes, and after a harvest that was killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tasks.harvest.library import harvest_style_library
from tasks.harvest.record import RECORDS_FOLDER
from tests.tasks.harvest.test_library import files, street_photo

MAX_SECONDS = 300


def read_results(folder: Path) -> dict[str, object]:
    """Files of a library by name, of the records all but their seconds."""
    records = {path.name: json.loads(path.read_bytes()) for path in (folder / RECORDS_FOLDER).iterdir()}
    assert all(record.pop("seconds") > 0 for record in records.values())
    return {**files(folder), **records}


def start_and_kill(pictures: Path, out: Path) -> None:
    """Kill a harvest by two processes, with its workers, once its first record is written."""
    command = [sys.executable, "-m", "flows", "harvest", str(pictures), "--out", str(out), "--workers", "2"]
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + MAX_SECONDS
    while process.poll() is None and not list((out / RECORDS_FOLDER).glob("*.json")):
        assert time.monotonic() < end
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.long
def test_processes_and_kills_change_nothing(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    photo = street_photo()[..., :3]
    for name, image in {"a": photo, "b": photo[:, ::-1], "c": photo // 2, "d": np.full_like(photo, 90)}.items():
        Image.fromarray(np.ascontiguousarray(image)).save(pictures / f"{name}.png")
    one, two = tmp_path / "one", tmp_path / "two"
    harvest_style_library([pictures], one, most=2, workers=1)
    start_and_kill(pictures, two)
    assert harvest_style_library([pictures], two, most=2, workers=2).earlier >= 1
    assert read_results(two) == read_results(one)
