"""Published files that are lost or cut: a run sees it, says so by not being done, and makes them again as they were."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from catalogs.published.file_list import find_snapshot_damage
from catalogs.published.snapshot import current_snapshot
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from flows.cli.commands import command_line
from flows.run_entry import open_run
from tasks.doctor import examine_folder
from tasks.engine.run import Run
from tasks.engine.store.integrity import repair_store
from tasks.engine.store.status import completion_summary
from tasks.publish.task import publish_block
from tests.faults.test_damaged_stores import flip_bit

pytestmark = pytest.mark.long


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def garbled(path: Path) -> None:
    path.write_bytes(b"\0" * path.stat().st_size)


DAMAGES: list[tuple[str, Callable[[Path], None]]] = [
    ("block.glb", Path.unlink),
    ("block.glb", cut),
    ("report", shutil.rmtree),
    ("report/index.html", cut),
    ("pages", shutil.rmtree),
    ("tiles", shutil.rmtree),
    ("overview.glb", cut),
    ("stac", shutil.rmtree),
    ("items.parquet", Path.unlink),
    ("items.parquet", cut),
    ("items.parquet", garbled),
    ("masked.json", Path.unlink),
    ("summary.json", Path.unlink),
    ("summary.json", cut),
    ("summary.json", garbled),
    ("files.json", cut),
    ("", shutil.rmtree),
    ("../../current", Path.unlink),
    ("../../current", cut),
    ("../../current", garbled),
    ("../../current", lambda path: path.write_bytes(b"\xff\xfe../..")),
    ("../../catalog.json", Path.unlink),
    ("../../catalog.json", cut),
]


def test_what_is_damaged_is_not_taken_for_done_and_is_made_again(textured: tuple[Path, Run], run: Run) -> None:
    done = completion_summary(run)
    assert done is not None
    out = Path(run.out)
    snapshot = current_snapshot(out).id
    published = out / "published" / snapshot
    kept = out.parent / "kept"
    shutil.copytree(out, kept)
    for name, damage in DAMAGES:
        damage(published / name)
        assert completion_summary(run) is None, name
        shutil.rmtree(published, ignore_errors=True)
        shutil.copytree(kept / "published" / snapshot, published)
        for pointer in ("current", "catalog.json"):
            shutil.copy2(kept / pointer, out / pointer)
        assert completion_summary(run) == done
    (published / "block.glb").unlink()
    cut(published / "items.parquet")
    publish_block.fn(run, textured[0])
    assert completion_summary(run) == done
    assert _contents(published) == _contents(kept / "published" / snapshot)
    assert sorted(path.name for path in (out / "published").iterdir()) == [snapshot]


def test_a_flipped_bit_is_not_linked_into_the_next_snapshot_and_is_repaired_after_the_doctor(
    textured: tuple[Path, Run], run: Run
) -> None:
    out = Path(run.out)
    published = out / "published" / current_snapshot(out).id
    kept = shutil.copytree(published, out.parent / "kept")
    assert completion_summary(run) is not None
    names = [path.relative_to(published).as_posix() for path in sorted(published.rglob("*")) if path.is_file()]
    names = [name for name in names if name.endswith((".glb", ".jpg", ".webp", "index.html"))]
    assert {"block.glb", "overview.glb", "pages/0000.jpg", "report/index.html"} < set(names)
    for name in names:
        flip_bit(published / name)
    assert find_snapshot_damage(published) is None, "no size shows it"
    assert "is not as it was written" in next(one.message for one in examine_folder(out) if one.concern == "published")
    assert completion_summary(run) is None
    assert repair_store(run) == []
    publish_block.fn(run, textured[0])
    assert _contents(published) == _contents(kept)
    assert completion_summary(run) is not None
    for name in names:
        flip_bit(published / name)
    session = open_repository(run.store).writable_session(BRANCH)
    open_root(session).attrs["published_by"] = "other code"
    commit(session, "published anew")
    publish_block.fn(run, textured[0])
    newer = out / "published" / current_snapshot(out).id
    assert newer != published
    again = _contents(newer)
    assert {name: again[name] for name in names if name.endswith((".glb", ".jpg", ".webp"))} == {
        name: data for name, data in _contents(kept).items() if name in names and not name.endswith(".html")
    }


def test_a_damaged_catalogue_is_named_with_the_remedy(run: Run) -> None:
    items = current_snapshot(Path(run.out)).items
    whole = items.read_bytes()
    for place in range(100, len(whole), len(whole) // 10):
        items.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        for words in (
            ["query", run.out],
            ["query", run.out, "--where", "height_m > 0"],
            ["export", run.out, "--format", "gpkg"],
        ):
            said = CliRunner().invoke(command_line, words)
            assert said.exit_code == 2, said.output
            assert "items.parquet is not as it was written; `streetloom run " in said.stderr


def test_a_removed_link_to_the_newest_snapshot_is_made_again(textured: tuple[Path, Run], run: Run) -> None:
    link = Path(run.out) / "latest"
    shutil.rmtree(link)  # a copy of the folder has a folder in its place
    with open_run(textured[0], Path(run.out), notify=print) as held:
        assert held.summary is not None
    assert link.readlink() == Path("published") / current_snapshot(Path(run.out)).id


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
