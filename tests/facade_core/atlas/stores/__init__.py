"""Stores that earlier versions made, as they lay in a run's folder.

format-2.tar.xz: revision 6eff616, `tests.pipeline.stages` with BUILDINGS and STREETS below, its history expired.
"""

from __future__ import annotations

import tarfile
from pathlib import Path

FORMAT_2 = Path(__file__).with_name("format-2.tar.xz")
BUILDINGS = {"a": (4, 5, 12, 2.8, 7.0)}
STREETS = {"1": [(0, 0), (18, 0)]}


def unpack(store: Path, out: Path) -> Path:
    """Lay one of the stores into the folder of a run, which is returned."""
    with tarfile.open(store) as tar:
        tar.extractall(out, filter="data")
    return out
