"""The package as users install it: what is in it, and that it runs outside a clone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import pytest

from tasks.engine.stage_code import VERSION

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install(ROOT, tmp_path_factory.mktemp("wheel"))


def install(project: Path, folder: Path) -> Path:
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder],
        cwd=project, check=True, capture_output=True,
    )  # fmt: skip
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(site: Path, *arguments: str, without_clone: bool = False) -> subprocess.CompletedProcess[str]:
    """Run Python on an installed package; `without_clone` hides the clone that the environment has installed."""
    environment = os.environ | {"PYTHONPATH": str(site)}
    if without_clone:
        environment["PYTHONPATH"] += os.pathsep + sysconfig.get_path("purelib")
        arguments = ("-S", *arguments)  # runs no .pth file
    return subprocess.run(
        [sys.executable, *arguments], cwd=site.parent, env=environment, capture_output=True, text=True, check=False
    )


def test_a_wheel_holds_models_examples_and_pages_and_neither_tests_nor_benchmarks(installed: Path) -> None:
    held = {path.relative_to(installed) for path in installed.rglob("*") if path.is_file()}
    rooms = {path.parts[0] for path in held}
    ours = {"catalogs", "facade_core", "flows", "tasks", "streetloom"}
    assert {room for room in rooms if not room.endswith(".dist-info")} == ours
    assert {path.name for path in held if "licenses" in path.parts} == {"LICENSE", "LICENCES.md", "LICENCES.txt"}
    tracked = subprocess.run(["git", "ls-files", *sorted(ours)], cwd=ROOT, capture_output=True, text=True, check=True)
    assert {Path(line) for line in tracked.stdout.splitlines()} <= held


def test_training_is_a_package_of_its_own(installed: Path, tmp_path: Path) -> None:
    command = ("-m", "flows", "train", "materials", "--data", str(tmp_path), "--out", str(tmp_path))
    absent = run(installed, *command, without_clone=True)
    assert absent.returncode == 2, absent.stderr
    assert absent.stderr.startswith("streetloom: train: the package streetloom-training is not installed; ")
    assert "`make train-setup`" in absent.stderr
    assert absent.stderr.count("\n") == 1
    assert run(installed, "-m", "flows", "train", "materials", "--help", without_clone=True).returncode == 0
    (tmp_path / "wheel").mkdir()
    shutil.copytree(installed, tmp_path / "site")
    shutil.copytree(install(ROOT / "training", tmp_path / "wheel"), tmp_path / "site", dirs_exist_ok=True)
    present = run(tmp_path / "site", *command, without_clone=True)
    assert "give --data a folder with materials/" in present.stderr, present.stderr
    parts = ", ".join(f"training.{name}" for name in ("layout.train", "parser.train", "windows"))
    imported = run(tmp_path / "site", "-c", f"import {parts}", without_clone=True)
    assert imported.returncode == 0, imported.stderr
    bench = run(tmp_path / "site", "-m", "flows", "bench", without_clone=True)
    assert bench.stderr.startswith("streetloom: bench: benchmarks come with a clone"), bench.stderr


def test_training_has_the_version_of_the_package() -> None:
    package, training = (
        tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"] for folder in (".", "training")
    )
    assert training["version"] == package["version"]
    assert training["dependencies"] == [f"streetloom[train]=={package['version']}"]
    assert "train" in package["optional-dependencies"]


@pytest.mark.long
def test_it_runs_outside_a_clone_as_the_same_code(installed: Path) -> None:
    where = run(installed, "-c", "import flows; print(flows.__file__)")
    assert Path(where.stdout.strip()).is_relative_to(installed)
    told = run(installed, "-m", "streetloom", "--version")
    here = subprocess.run(
        [sys.executable, "-m", "flows", "--version"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert told.stdout == here.stdout
    assert told.stdout.startswith(f"streetloom {VERSION}+")
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
