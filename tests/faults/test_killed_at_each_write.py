"""SIGKILL before each change of a file: what is left can be read, and the same again gives what one undisturbed gives."""

from __future__ import annotations

import gc
import hashlib
import os
import shutil
import signal
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from PIL import Image

from catalogs.block.corrections import Correction, append_corrections_to_file, read_corrections
from catalogs.imagery.fetch_log import FETCH_LOG_NAME, read_fetch_log
from catalogs.imagery.fetching import fetch_panoramas
from catalogs.imagery.remote_panorama import RemotePanorama
from catalogs.readers.pictures.poses import read_poses_file
from facade_core.core.types import Pose
from tasks.city.city_log import load_or_partition_city, read_city_log
from tasks.matching.match_table import COLUMNS, MatchTable, read_match_table, write_match_table
from tasks.matching.photo_import import import_photos, plan_photo_import
from tests.faults.test_killed_commands import file_digests
from tests.pipeline.stages import write_block
from tests.pipeline.test_city import HOUSES, STREETS

# Audit events of the interpreter that change files, with the path first.
CHANGES = ("os.rename", "os.remove", "os.link", "os.truncate", "os.mkdir", "os.rmdir", "shutil.copyfile")
# More changes than any of the functions makes.
MAX_CHANGES = 100


def changes_file(event: str, arguments: tuple[object, ...], folder: Path) -> bool:
    """Report whether an audit event is a change below a folder."""
    opens = event == "open" and (
        any(letter in str(arguments[1] or "") for letter in "wax+")
        or bool(int(str(arguments[2] or 0)) & (os.O_WRONLY | os.O_RDWR))
    )
    return (opens or event in CHANGES) and str(folder) in str(arguments[0])


def kill_before_change(number: int, folder: Path, function: Callable[[], object]) -> bool:
    """Run a function in a process that is killed before its change of this number; returns whether it came to that."""
    gc.collect()
    child = os.fork()
    if child == 0:
        count = [0]

        def watch(event: str, arguments: tuple[object, ...]) -> None:
            if changes_file(event, arguments, folder):
                count[0] += 1
                if count[0] == number:
                    os.kill(os.getpid(), signal.SIGKILL)

        try:
            signal.alarm(300)
            sys.addaudithook(watch)
            function()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    status = os.waitpid(child, 0)[1]
    killed = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL
    assert killed or status == 0, f"the process ended with {status}"
    return killed


def kept_digests(folder: Path) -> dict[str, str]:
    """Return the digests of files but drafts, which nothing reads."""
    return {name: digest for name, digest in file_digests(folder).items() if not name.endswith(".tmp")}


def kill_at_each_change(
    work: Path,
    prepare: Callable[[Path], None],
    run: Callable[[Path], object],
    check: Callable[[Path], None],
    step: int = 1,
) -> int:
    """Kill `run` in a new folder before every `step`-th of its changes, `check` what is left, and run again; returns the kills.

    The files must be as those of a run that nothing kills.
    """
    folder = work / "folder"  # of one name, as files hold paths
    folder.mkdir(parents=True)
    prepare(folder)
    shutil.copytree(folder, work / "before")
    assert not kill_before_change(0, folder, lambda: run(folder))
    expected = kept_digests(folder)
    for number in range(1, MAX_CHANGES, step):
        shutil.rmtree(folder)
        shutil.copytree(work / "before", folder)
        if not kill_before_change(number, folder, lambda: run(folder)):
            return number - 1
        check(folder)
        assert not kill_before_change(0, folder, lambda: run(folder)), number
        assert kept_digests(folder) == expected, number
    pytest.fail("does not end")


@pytest.mark.long
def test_partition_of_a_city(tmp_path: Path) -> None:
    def prepare(folder: Path) -> None:
        keys = yaml.safe_load(write_block(folder, buildings=HOUSES, streets=STREETS).read_text())
        (folder / "town.yaml").write_text(yaml.safe_dump(keys | {"name": "town", "cut": {"metres": 70}}))

    def run(folder: Path) -> None:
        load_or_partition_city(folder / "town.yaml", folder / "out")

    def check(folder: Path) -> None:
        assert read_city_log(folder / "out").name in ("", "town")

    assert kill_at_each_change(tmp_path, prepare, run, check, step=3) >= 10


def test_fetch(tmp_path: Path) -> None:
    offers = [RemotePanorama(name, f"http://x/{name}.jpg", Pose(24.94, 60.16, None, heading=9.0)) for name in "abc"]
    (tmp_path / "offered").mkdir()
    for number, offer in enumerate(offers):
        Image.new("RGB", (64, 32), (40 * number, 99, 99)).save(tmp_path / "offered" / offer.id, "JPEG")

    def download(panorama: RemotePanorama, part: Path) -> str:
        assert f'"id": "{panorama.id}"' not in (part.parents[1] / FETCH_LOG_NAME).read_text(), "it was fetched before"
        part.write_bytes((tmp_path / "offered" / panorama.id).read_bytes())
        return hashlib.sha256(part.read_bytes()).hexdigest()

    def run(folder: Path) -> None:
        log = read_fetch_log(folder / "panoramas")
        for offer in offers:  # one after the other, so that the log is the same each time
            assert fetch_panoramas("s", [offer], log, download, lambda _: None, lambda _: None) == []
        log.write_poses()

    logged: set[int] = set()

    def check(folder: Path) -> None:
        if (folder / "panoramas").is_dir():
            log = read_fetch_log(folder / "panoramas")
            assert all(log.find_picture("s", name) for _, name in log.pictures)
            logged.add(len(log.pictures))
        if (folder / "panoramas" / "poses.json").is_file():
            assert len(read_poses_file(folder / "panoramas" / "poses.json").poses) == 3

    assert kill_at_each_change(tmp_path, lambda folder: None, run, check) >= 12
    assert logged == {0, 1, 2, 3}


def write_matched_block(folder: Path) -> None:
    """Write a block with a copy of a photo that its table names for another facade, and one photo more."""
    (folder / "mine").mkdir()
    for number in (1, 2):
        Image.new("RGB", (64, 48), (40 * number, 99, 99)).save(folder / "mine" / f"{number}.jpg")
    block = write_block(folder / "block")
    (block.parent / "matches.csv").write_text("photo,facade\n1.jpg,a-0\n")
    import_photos(plan_photo_import(block, folder / "mine", read_match_table(block.parent / "matches.csv")))
    (block.parent / "matches.csv").write_text("photo,facade\n1.jpg,b-0\n2.jpg,a-1\n")


@pytest.mark.long
def test_photos_of_a_match(tmp_path: Path) -> None:
    def run(folder: Path) -> None:
        table = read_match_table(folder / "block" / "matches.csv")
        import_photos(plan_photo_import(folder / "block" / "block.yaml", folder / "mine", table))

    def check(folder: Path) -> None:
        assert len(list((folder / "mine").iterdir())) == 2

    assert kill_at_each_change(tmp_path, write_matched_block, run, check) >= 5


def test_table_and_corrections(tmp_path: Path) -> None:
    row = dict.fromkeys(COLUMNS, "") | {"photo": "1.jpg", "facade": "a-0"}
    correction = Correction("a", "height", 12.5, when="2026-01-02T03:04:05Z")

    def prepare(folder: Path) -> None:
        (folder / "block.yaml").write_text("name: b\n")
        write_match_table(MatchTable(folder / "old.csv", COLUMNS, (row,)))
        append_corrections_to_file(folder / "block.yaml", [Correction("b", "height", 9.0)])

    def run(folder: Path) -> None:
        write_match_table(MatchTable(folder / "old.csv", COLUMNS, (row, row)))
        if not (folder / "new.csv").exists():
            write_match_table(MatchTable(folder / "new.csv", COLUMNS, (row,)), new=True)
        if "a" not in read_corrections(folder / "block.yaml").by_target:
            append_corrections_to_file(folder / "block.yaml", [correction])

    def check(folder: Path) -> None:
        assert len(read_match_table(folder / "old.csv").rows) in (1, 2)
        if (folder / "new.csv").exists():
            assert len(read_match_table(folder / "new.csv").rows) == 1
        assert set(read_corrections(folder / "block.yaml").by_target) in ({"b"}, {"a", "b"})

    assert kill_at_each_change(tmp_path, prepare, run, check) >= 7
