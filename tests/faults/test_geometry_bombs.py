"""Small files that would fill the memory, and mutations of sound ones: refused in a line, or read; no process ends."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from geometry_bombs import BOMBS  # noqa: E402
from geometry_files import BUILDINGS, STREETS  # noqa: E402
from small_files import SMALL_FILES  # noqa: E402

MUTATIONS = 30  # of each file


def run(script: str, *arguments: str) -> str:
    """What a script beside this one prints; a reader that crashes takes its process with it, not this one."""
    here = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE.parents[1]), str(HERE)])}
    found = subprocess.run(
        [sys.executable, str(HERE / script), *arguments], capture_output=True, text=True, env=here, check=False
    )
    assert found.returncode == 0, f"{found.stdout[-300:]} ended it with {found.returncode}: {found.stderr[-2000:]}"
    return found.stdout


def test_files_that_unpack_to_more_than_memory_are_refused_in_a_line(tmp_path: Path) -> None:
    lines = run("geometry_bombs.py", str(tmp_path)).splitlines()
    assert [line.split()[0] for line in lines] == list(BOMBS)
    wrong = [line for line in lines if not line.split(" ", 1)[1].startswith(("refused", "read"))]
    assert not wrong
    assert {line.split()[0] for line in lines if line.endswith(" read")} <= {"circle.gltf", "twice.gltf"}
    assert all("; " in line for line in lines if not line.endswith(" read"))


@pytest.mark.parametrize(
    ("kind", "files"),
    [
        ("buildings", BUILDINGS),
        ("streets", STREETS),
        pytest.param("small", {name: file.write for name, file in SMALL_FILES.items()}, marks=pytest.mark.long),
    ],
)
def test_mutated_files_are_read_or_refused(
    kind: str, files: Mapping[str, Callable[[Path], None]], tmp_path: Path
) -> None:
    for name, write in files.items():
        (tmp_path / name).mkdir()
        write(tmp_path / name / name)
    beside = [str(tmp_path / name / name) for name in files]
    lines = [line for line in run("mutated.py", kind, "20", str(MUTATIONS), *beside).splitlines() if line.strip()]
    assert lines == [f"{path}: {MUTATIONS}" for path in beside]
