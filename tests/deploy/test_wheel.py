"""The package as users install it: what is in it, and that it runs outside a clone."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder],
        cwd=ROOT, check=True, capture_output=True,
    )  # fmt: skip
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(installed: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(installed)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=installed.parent, env=environment, capture_output=True, text=True, check=False
    )


def test_a_wheel_holds_models_examples_and_pages_and_neither_tests_nor_benchmarks(installed: Path) -> None:
    held = {path.relative_to(installed) for path in installed.rglob("*") if path.is_file()}
    rooms = {path.parts[0] for path in held}
    ours = {"catalogs", "facade_core", "flows", "tasks", "streetloom"}
    assert {room for room in rooms if not room.endswith(".dist-info")} == ours
    assert {path.name for path in held if "licenses" in path.parts} == {"LICENSE", "LICENCES.md"}
    tracked = subprocess.run(["git", "ls-files", *sorted(ours)], cwd=ROOT, capture_output=True, text=True, check=True)
    assert {Path(line) for line in tracked.stdout.splitlines()} <= held


@pytest.mark.long
def test_it_runs_outside_a_clone_as_the_same_code(installed: Path) -> None:
    where = run(installed, "-c", "import flows; print(flows.__file__)")
    assert Path(where.stdout.strip()).is_relative_to(installed)
    told = run(installed, "-m", "streetloom", "--version")
    here = subprocess.run(
        [sys.executable, "-m", "flows", "--version"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert told.stdout == here.stdout
    assert told.stdout.startswith("streetloom 0.1.0+")
    checked = run(installed, "-m", "flows", "doctor")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert "models" in checked.stdout


def test_a_shell_completes_commands_and_values() -> None:
    def completed(words: str, place: int) -> list[str]:
        environment = os.environ | {
            "COMP_WORDS": words,
            "COMP_CWORD": str(place),
            "_STREETLOOM_COMPLETE": "bash_complete",
        }
        command = "from flows.cli.commands import command_line; command_line(prog_name='streetloom')"
        shown = subprocess.run(
            [sys.executable, "-c", command], env=environment, capture_output=True, text=True, check=False
        )
        return shown.stdout.split()

    assert completed("streetloom que", 1) == ["plain,query"]
    assert completed("streetloom query out --format ", 4) == [
        "plain,table", "plain,json", "plain,geojson", "plain,parquet",
    ]  # fmt: skip
