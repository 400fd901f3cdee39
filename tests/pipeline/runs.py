"""A small block for whole runs: two crossing streets, a handful of boxes, three exemplars, one photo with a hole."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from facade_core.core.errors import InputError
from flows.lock import lock_folder

ROOT = Path(__file__).resolve().parents[2]
# In which a command ends that takes a minute where nothing else runs, seconds: bounds a hang, and no more.
PATIENCE_S = 1200


def write_block(folder: Path) -> Path:
    """Input of a small block cut from the real extract, seeded and complete; returns its block file."""
    from benchmarks.painter.paint_demo import paint_exemplars, paint_photos
    from catalogs.block.reader import read_block
    from tasks.examples.demo import copy_map, write_block_file

    copy_map(folder)
    paint_exemplars(folder / "exemplars", 4)
    block = folder / "helsinki.yaml"
    write_block_file(block, folder / "exemplars", photos=False)
    keys = yaml.safe_load(block.read_text())
    keys["area"] = [24.9471, 60.1659, 24.9488, 60.1667]
    keys["streets"]["names"] = ["Kasarmikatu", "Rikhardinkatu"]
    keys["texture"] = {"texels_per_metre": 6}  # without a sun, in whose light a photo's texels are not the photo's
    block.write_text(yaml.safe_dump(keys, sort_keys=False))
    paint_photos(read_block(block), folder / "photos")
    keys["imagery"]["photos"] = {"path": "photos"}
    block.write_text(yaml.safe_dump(keys, sort_keys=False))
    return block


# What a user types, and the same with small views.
TYPED, SMALL = "flows", "tests.pipeline.small_views"


def command(block: Path, out: Path, workers: int, program: str = SMALL) -> list[str]:
    return [sys.executable, "-m", program, "run", str(block), "--out", str(out), "--workers", str(workers), "--json"]


def environment(home: Path) -> dict[str, str]:
    """The environment of a run: no server of the user's, no colour."""
    return {k: v for k, v in os.environ.items() if not k.startswith("PREFECT_")} | {"HOME": str(home), "NO_COLOR": "1"}


LOOPBACK_UP = """
import fcntl, os, socket, struct, sys
UP, SET_FLAGS = 0x1 | 0x40, 0x8914
fcntl.ioctl(socket.socket(), SET_FLAGS, struct.pack("16sh", b"lo", UP))
os.execvp(sys.argv[1], sys.argv[1:])
"""
# A network namespace of its own, in which there is nothing but loopback.
ALONE = ["unshare", "--map-root-user", "--net", sys.executable, "-c", LOOPBACK_UP]


def run(
    block: Path, out: Path, workers: int = 2, expect: int = 0, within: Sequence[str] = (), program: str = SMALL
) -> dict[str, Any]:
    """Run a block as a user would, `within` another command if given; returns the JSON object printed last."""
    done = subprocess.run(
        [*within, *command(block, out, workers, program)],
        cwd=ROOT,
        env=environment(out.parent),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == expect, done.stderr[-3000:] + done.stdout[-2000:]
    printed: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return printed


def working_in(out: Path) -> bool:
    """Whether a run holds the folder."""
    try:
        with lock_folder(out):
            return False
    except InputError:
        return True
