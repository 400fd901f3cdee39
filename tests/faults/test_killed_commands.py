"""SIGKILL at random moments of import, export, prune and city: repeated, each gives the results of one undisturbed.

STREETLOOM_KILLS says how often; commands take turns, the city last.
"""

from __future__ import annotations

import hashlib
import json
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import pytest
import yaml

from catalogs.published.snapshot import current_snapshot
from catalogs.query.execution import query
from tasks.engine.run import Run
from tasks.engine.store.status import record_run_block_file
from tests.faults.test_killed_at_random import KILLS
from tests.faults.test_prune import published_again
from tests.pipeline.runs import PATIENCE_S, ROOT, environment
from tests.pipeline.stages import digests_of, write_block
from tests.pipeline.test_city import HOUSES, STREETS

pytestmark = [pytest.mark.long, pytest.mark.timeout(1200 + 120 * KILLS)]


@dataclass(frozen=True)
class Command:
    """Command in a folder that `prepare` fills.

    Attributes
    ----------
    words : arguments of streetloom, by the folder.
    find_results : returns what the command made, equal after every repetition.
    leftovers : patterns of files that no command may leave.
    """

    prepare: Callable[[Path], None]
    words: Callable[[Path], list[str]]
    find_results: Callable[[Path], object]
    leftovers: tuple[str, ...]


def start(words: list[str], home: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "flows", *words],
        cwd=ROOT,
        env=environment(home),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finish(words: list[str], home: Path) -> float:
    """Run a command to its end; returns its seconds."""
    began = time.monotonic()
    process = start(words, home)
    said = process.communicate(timeout=PATIENCE_S)[1]
    assert process.returncode == 0, said
    return time.monotonic() - began


def file_digests(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def read_corrections(folder: Path) -> list[dict[str, object]]:
    lines = (folder / "block" / "block.corrections.jsonl").read_text().splitlines()
    return [{key: value for key, value in json.loads(line).items() if key != "when"} for line in lines]


@pytest.fixture
def commands(textured: tuple[Path, Run], run: Run) -> dict[str, Command]:
    block = textured[0].parent
    source = Path(run.out)
    facade = query(source, where="role = 'street'")["id"].iloc[0]
    first = current_snapshot(source).id
    published_again(run, textured[0])
    assert len([path for path in (source / "published").iterdir() if path.is_dir()]) == 2

    def copy_run(folder: Path) -> None:
        shutil.copytree(source, folder / "out")
        shutil.copytree(block, folder / "block")
        record_run_block_file(folder / "out", folder / "block" / "block.yaml")
        boxes = [{"facade_id": facade, "elements": [["door", 0.4, 0.7, 0.5, 1.0]]}]
        (folder / "said.json").write_text(json.dumps({"corrections": boxes}))

    def write_city(folder: Path) -> None:
        keys = yaml.safe_load(write_block(folder, buildings=HOUSES, streets=STREETS).read_text())
        (folder / "town.yaml").write_text(yaml.safe_dump(keys | {"name": "town", "cut": {"metres": 70}}))

    def find_pruned(folder: Path) -> object:
        names = sorted(path.name for path in (folder / "out" / "published").iterdir())
        assert first not in names
        return names, digests_of(folder / "out")

    def find_city(folder: Path) -> object:
        rows = query(folder / "out")[["id", "kind", "status"]].sort_values(["kind", "id"])
        blocks = sorted((folder / "out" / "blocks").iterdir())
        return rows.to_dict("records"), [digests_of(path) for path in blocks if (path / "store").is_dir()]

    run_leftovers = ("out/published/.*", "out/.current.tmp", "out/.seen-*", "out/.catalog.json.*")
    return {
        "export": Command(
            copy_run,
            lambda folder: ["export", str(folder / "out"), "--format", "cityjson", "--to", str(folder / "model")],
            lambda folder: file_digests(folder / "model"),
            (".model.*",),
        ),
        "import": Command(
            copy_run,
            lambda folder: ["import", str(folder / "out"), str(folder / "said.json"), "--who", "anna"],
            read_corrections,
            ("block/.*",),
        ),
        "prune": Command(
            copy_run, lambda folder: ["prune", str(folder / "out"), "--keep", "1"], find_pruned, run_leftovers
        ),
        "city": Command(
            write_city,
            lambda folder: [
                "city",
                str(folder / "town.yaml"),
                "--out",
                str(folder / "out"),
                "--workers",
                "1",
                "--json",
            ],
            find_city,
            ("out/blocks/*/published/.*", "out/.*.tmp", "out/blocks/*/.current.tmp"),
        ),
    }


def test_commands_killed_at_random_moments(commands: dict[str, Command], tmp_path: Path) -> None:
    draw = random.Random(46)
    undisturbed: dict[str, tuple[float, object]] = {}
    for number, name in zip(range(KILLS), cycle(commands), strict=False):
        command = commands[name]
        if name not in undisturbed:
            undisturbed[name] = run_whole(command, tmp_path / f"whole-{name}")
        seconds, expected = undisturbed[name]
        folder = tmp_path / f"{name}-{number}"
        folder.mkdir()
        command.prepare(folder)
        process = start(command.words(folder), folder)
        time.sleep(draw.uniform(0.3, 1.0) * seconds)
        process.kill()
        assert "Traceback" not in process.communicate(timeout=PATIENCE_S)[1]
        wait_for_children(folder)
        finish(command.words(folder), folder)
        assert command.find_results(folder) == expected, name
        assert left_over(command, folder) == [], name
        shutil.rmtree(folder)


def run_whole(command: Command, folder: Path) -> tuple[float, object]:
    folder.mkdir()
    command.prepare(folder)
    seconds = finish(command.words(folder), folder)
    assert left_over(command, folder) == []
    return seconds, command.find_results(folder)


def left_over(command: Command, folder: Path) -> list[str]:
    return [path.name for pattern in command.leftovers for path in folder.glob(pattern)]


def wait_for_children(folder: Path) -> None:
    """Wait until no process names the folder: blocks of a killed city end with it."""
    deadline = time.monotonic() + PATIENCE_S
    while any(_name_folder(folder)) and time.monotonic() < deadline:
        time.sleep(0.2)


def _name_folder(folder: Path) -> Iterator[str]:
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = path.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if str(folder) in line:
            yield line
