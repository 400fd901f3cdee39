"""A disk without room ends the run with one line, and marks no unit as failed; with room again, the run goes on."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from facade_core.core.errors import MachineError
from flows.cli.commands import command_line
from tasks.engine.outcome import convert_machine_faults
from tasks.engine.run import Run
from tasks.engine.store import disk_space
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.disk_space import RESERVED_BYTES, require_disk_space
from tasks.stages.ingest import task
from tasks.stages.order import STAGE_NAMES
from tests.pipeline.runs import ROOT, command, environment
from tests.pipeline.stages import digests_of, texture, write_block


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk in memory that holds the first facades of the block and not the rest."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=450k", "tmpfs", folder], capture_output=True, text=True
    )
    if mounted.returncode:
        pytest.skip(f"no disk of a size can be mounted here: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


def states(out: Path) -> set[str]:
    return {record["status"] for stage in STAGE_NAMES for record in read_newest_journal(out / "store", stage) if record}


def test_a_disk_that_fills_ends_the_run_which_goes_on_when_there_is_room(
    disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    block = write_block(tmp_path / "block", texture={"walls": "translate"})
    monkeypatch.setattr(disk_space, "RESERVED_BYTES", 0)
    monkeypatch.setattr(task, "required_block_bytes", lambda plan, stored: 0)  # as if another program had filled it
    with (
        pytest.raises(
            MachineError, match=r"No space left on device; free some space and run again: finished work is kept$"
        ),
        convert_machine_faults("small"),
    ):
        texture(block, disk / "out")
    assert states(disk / "out") == {"done"}
    subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
    texture(block, disk / "out")
    assert states(disk / "out") == {"done"}
    texture(block, tmp_path / "out")
    assert digests_of(disk / "out") == digests_of(tmp_path / "out")


def test_a_disk_without_room_is_told_before_anything_is_written(tmp_path: Path) -> None:
    def left(bytes_free: int) -> Callable[[Path], int]:
        return lambda folder: RESERVED_BYTES + bytes_free if folder == tmp_path else 0

    require_disk_space(tmp_path, 200_000, left(200_000))
    with pytest.raises(
        MachineError, match=r"needs about 55 MB of space and its disk has 50 MB free; free some space, or"
    ):
        require_disk_space(tmp_path, 5_000_000, left(300_000))
    with pytest.raises(MachineError, match="free some space"):
        require_disk_space(tmp_path, 250_000, left(200_000))
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "chunk").write_bytes(bytes(100_000))  # of what is needed, this is there already
    require_disk_space(tmp_path, 250_000, left(200_000))


def test_the_command_says_what_room_it_needs(disk: Path, tmp_path: Path) -> None:
    block = write_block(tmp_path / "block")
    done = subprocess.run(
        command(block, disk / "out", 2),
        cwd=ROOT,
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 70
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"streetloom: {disk}/out: needs about 50 MB of space and its disk has 0 MB free; ")
    assert done.stdout == ""
    assert not (disk / "out" / "store").exists()


def test_a_disk_that_fills_while_a_geopackage_is_written(textured: tuple[Path, Run], disk: Path) -> None:
    words = ["export", textured[1].out, "--format", "gpkg", "--to", str(disk / "map.gpkg")]
    subprocess.run(["mount", "-o", "remount,size=100k", disk], check=True)
    said = CliRunner().invoke(command_line, words)
    assert said.exit_code == 70
    assert said.stderr.splitlines()[-1].endswith("free some space, or name another place")
    assert list(disk.iterdir()) == []
    subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
    assert CliRunner().invoke(command_line, words).exit_code == 0


def test_a_closed_standard_output_is_one_line(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "flows", "--version"]
    done = subprocess.run(
        ["bash", "-c", 'exec "$@" >&-', "bash", *line], cwd=ROOT, stderr=subprocess.PIPE, text=True, timeout=100
    )
    assert done.returncode == 2
    assert done.stderr == "streetloom: standard output is closed; send it to a file, or to /dev/null\n"
