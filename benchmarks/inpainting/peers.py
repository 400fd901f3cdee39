"""Inpainters and a perceptual distance to compare with, each in an environment of its own.

A peer is a script of deploy/peers/, run by the interpreter of an environment that `environment` makes on demand from the
requirements beside it; nothing of it reaches the product's own environment.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

PEERS = Path(__file__).resolve().parents[2] / "deploy" / "peers"


def environment(name: str, folder: Path) -> Path:
    """The interpreter of peer NAME's environment under a folder, made unless it is there with the same pins. Raises
    RuntimeError with pip's last words where it cannot be."""
    wanted = PEERS / f"{name}.txt"
    place = folder / f"{name}-{hashlib.sha256(wanted.read_bytes()).hexdigest()[:12]}"
    python = place / "bin" / "python"
    if not (place / "ready").exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(place)], check=True)
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", str(wanted)]
        done = subprocess.run(install, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"peer {name} cannot be installed: {done.stderr.strip()[-300:]}")
        (place / "ready").touch()
    return python


def run(name: str, folder: Path, *arguments: str | Path) -> dict[str, Any]:
    """What the peer's script prints last, as JSON. Raises RuntimeError with its error where it fails."""
    command = [str(environment(name, folder)), str(PEERS / f"{name}.py"), *map(str, arguments)]
    quiet = {**os.environ, "PYTHONPATH": "", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=quiet, check=False)
    if done.returncode:
        raise RuntimeError(f"peer {name} failed: {done.stderr.strip()[-500:]}")
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))
