"""Shared fixtures: the data folder for tests of real data, and one whole run that many tests look at."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from tasks.engine.compute.worker_setup import limit_threads
from tasks.engine.kernel_compilation import compile_kernels_once
from tasks.publish.published_run import PublishedBlock, open_published_run
from tests.chromium import browser as browser  # one for all: Playwright is started once in a process
from tests.pipeline import stages
from tests.pipeline.painted_panoramas import CAMERAS, PICTURED, write_panoramas
from tests.pipeline.runs import TYPED, run, write_block
from tests.sharing import alone
from tests.skips import find_unknown_reasons

# The same examples each time, however long one takes.
settings.register_profile("suite", derandomize=True, deadline=None)
settings.load_profile("suite")

ROOT = Path(__file__).resolve().parent.parent
# Files and folders that take long, the longest first. Files are handed to the suite's processes in the order of collection:
# what takes long and begins last would have one process wait for the other. The second needs no run that the first makes.
LONG = (
    "pipeline/test_whole_run.py",
    "faults/test_killed_at_random.py",
    "pipeline/test_deployments.py",
    "pipeline/test_rehearsal.py",
    "faults/test_hung_workers.py",
    "tasks/stages/test_memory.py",
    "pipeline",
    "tasks/city",
    "faults",
    "benchmarks",
    "browser",
    "tasks/engine/compute",
    "facade_core/parse",
    "tasks",
    "facade_core",
)


@pytest.hookimpl(tryfirst=True)  # before markers select tests
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that use the folder of real data, and begin with what takes longest."""
    for item in items:
        if "data" in getattr(item, "fixturenames", ()):
            item.add_marker("realdata")

    def place(item: pytest.Item) -> int:
        path = item.path.relative_to(ROOT / "tests").as_posix()
        return next((i for i, start in enumerate(LONG) if path.startswith(start)), len(LONG))

    items.sort(key=place)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail where tests were skipped for reasons that are not known; they are counted in the summary."""
    if _unknown_skips(session.config) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    for reason, count in _unknown_skips(config).items():
        terminalreporter.write_line(
            f"{count} skipped for a reason that tests/skips.py does not know: {reason}", red=True
        )


def _unknown_skips(config: pytest.Config) -> dict[str, int]:
    reporter: Any = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or hasattr(config, "workerinput"):
        return {}
    return find_unknown_reasons(str(report.longrepr[2]) for report in reporter.stats.get("skipped", []))


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real data; skips with the reason where it is absent."""
    folder = Path(os.environ.get("STREETLOOM_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no data folder at {folder}; set STREETLOOM_DATA")
    return folder


@pytest.fixture(scope="session")
def common(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """A folder that all processes of the suite see, and none else."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if hasattr(request.config, "workerinput") else base) / "common"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def _places(common: Path) -> None:
    """Nothing is left in the user's cache, where runs keep an empty database of Prefect's server, nor in the machine's folder
    of temporary files: Prefect, Dask and commands that fail leave some there."""
    os.environ["XDG_CACHE_HOME"] = str(common / "cache")
    (common / "tmp").mkdir(exist_ok=True)
    os.environ["TMPDIR"] = tempfile.tempdir = str(common / "tmp")


@pytest.fixture(scope="session", autouse=True)
def _threads() -> None:
    """The suite's processes share the cores as workers do, and threads that wait for others' work take time from it."""
    limit_threads()


@pytest.fixture(scope="session", autouse=True)
def _compiled(request: pytest.FixtureRequest, _threads: None) -> None:
    """The suite's processes share what is compiled on first use: else each that comes to it, and each run that one of them
    starts meanwhile, would compile it for itself. A process alone compiles what its tests need and no more."""
    if hasattr(request.config, "workerinput"):
        compile_kernels_once()


@pytest.fixture(scope="session")
def block(common: Path) -> Path:
    """A block cut from the real extract: written by whichever process of the suite asks first, since runs of others read it."""
    folder, told = common / "block", common / "block.done"
    with alone(common, "block"):
        if not told.is_file():
            write_block(folder)
            told.touch()
    return folder / "helsinki.yaml"


@pytest.fixture(scope="session")
def smallest(common: Path) -> Path:
    """A block of five boxes and three streets, for whole runs of which only their course matters."""
    with alone(common, "smallest"):
        file = common / "smallest" / "block.yaml"
        return file if file.is_file() else stages.write_block(file.parent)


@pytest.fixture(scope="session")
def undisturbed(block: Path, common: Path) -> tuple[Path, dict[str, Any]]:
    """One whole run with two workers that nothing disturbs: made by whichever process of the suite asks first."""
    out, told = common / "undisturbed" / "out", common / "undisturbed.json"
    with alone(common, "undisturbed"):
        if not told.is_file():
            out.parent.mkdir()
            told.write_text(json.dumps(run(block, out, workers=2, program=TYPED)))
    return out, json.loads(told.read_text())


@pytest.fixture(scope="session")
def pictured(common: Path) -> Path:
    """A folder with the smallest block, two panoramas of its ground and no exemplars, as `in`, and its stages done, not
    published, as `out`: made by whichever process of the suite asks first, read by all."""
    folder, told = common / "pictured", common / "pictured.done"
    with alone(common, "pictured"):
        if not told.is_file():
            write_panoramas(folder / "in", CAMERAS)
            stages.texture(stages.write_block(folder / "in", **PICTURED), folder / "out")
            told.touch()
    return folder


@pytest.fixture
def pictured_copy(pictured: Path, tmp_path: Path) -> Path:
    """The same, for a test to change."""
    return Path(shutil.copytree(pictured, tmp_path / "copy"))


@pytest.fixture(scope="module")
def found(undisturbed: tuple[Path, dict[str, Any]]) -> Iterator[PublishedBlock]:
    """What the run published that many tests look at."""
    with open_published_run(undisturbed[0]) as opened:
        yield opened
