"""A published snapshot: which one is current, who holds it, and what is said where it is not all there."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.published.snapshot import (
    SnapshotFolder,
    current_snapshot,
    find_current_snapshot,
    set_current_snapshot,
    snapshot_folder,
)
from facade_core.core.errors import InputError, StoreError


def publish_snapshot(out: Path, id: str) -> SnapshotFolder[Path]:
    """A snapshot with the files by which one is known."""
    snapshot = snapshot_folder(out, id)
    snapshot.folder.mkdir(parents=True)
    snapshot.items.touch()
    snapshot.summary.write_text('{"block": "b"}')
    return snapshot


def test_a_file_named_latest_stays(tmp_path: Path) -> None:
    (tmp_path / "latest").write_text("mine")
    set_current_snapshot(publish_snapshot(tmp_path, "ONE"))
    assert (tmp_path / "latest").read_text() == "mine"
    assert find_current_snapshot(tmp_path) is not None


def test_current_is_what_was_made_so_last(tmp_path: Path) -> None:
    assert find_current_snapshot(tmp_path) is None
    with pytest.raises(InputError, match="current cannot be read"):
        current_snapshot(tmp_path)
    first, second = publish_snapshot(tmp_path, "ONE"), publish_snapshot(tmp_path, "TWO")
    for snapshot in (first, second):
        set_current_snapshot(snapshot)
        assert current_snapshot(tmp_path) == find_current_snapshot(tmp_path) == snapshot
        assert (snapshot.id, snapshot.out) == (snapshot.folder.name, tmp_path)
        assert (tmp_path / "latest" / "summary.json").samefile(snapshot.summary)
    assert not (tmp_path / "latest").readlink().is_absolute(), "a copy of the folder links into itself"
    assert [path.name for path in tmp_path.glob("*current*")] == ["current"]
    assert second.read_run_summary() == {
        "block": "b",
        "outputs": {
            "glb": [f"{tmp_path}/published/TWO/block.glb"],
            "report": f"{tmp_path}/published/TWO/report/index.html",
            "items": f"{tmp_path}/published/TWO/items.parquet",
        },
    }
    assert second.page(7) == tmp_path / "published" / "TWO" / "pages" / "0007.jpg"


@pytest.mark.parametrize("name", ["", "..", "../ONE", "ONE/..", "ONE\0", "none"])
def test_a_pointer_to_nothing_is_refused(name: str, tmp_path: Path) -> None:
    publish_snapshot(tmp_path, "ONE")
    (tmp_path / "current").write_text(name)
    assert find_current_snapshot(tmp_path) is None
    with pytest.raises(InputError, match=r"`streetloom run BLOCK\.yaml --out .*` publishes again"):
        current_snapshot(tmp_path)


def test_who_goes_on_without_needs_the_summary_and_who_reads_the_table(tmp_path: Path) -> None:
    snapshot = publish_snapshot(tmp_path, "ONE")
    set_current_snapshot(snapshot)
    snapshot.items.unlink()
    assert find_current_snapshot(tmp_path) == snapshot
    with pytest.raises(InputError, match=r"items\.parquet is missing"):
        current_snapshot(tmp_path)
    snapshot.items.touch()
    snapshot.summary.unlink()
    assert find_current_snapshot(tmp_path) is None
    assert current_snapshot(tmp_path) == snapshot


def test_nobody_is_alone_where_somebody_reads(tmp_path: Path) -> None:
    snapshot = publish_snapshot(tmp_path, "ONE")
    with snapshot.hold_for_reading() as read, snapshot.hold_for_reading():
        assert read is snapshot
        with snapshot.lock_exclusively() as nobody:
            assert not nobody
    with snapshot.lock_exclusively() as nobody:
        assert nobody
    with snapshot_folder(tmp_path, "GONE").hold_for_reading() as gone:
        assert not gone.items.is_file()


def test_a_store_that_is_not_there_is_not_made(tmp_path: Path) -> None:
    snapshot = publish_snapshot(tmp_path, "ONE")
    with pytest.raises(StoreError, match=r"does not hold snapshot ONE .*there is none.*publishes again"):
        snapshot.open_session()
    assert not (tmp_path / "store").exists()
    (tmp_path / "store").mkdir()
    with pytest.raises(StoreError, match="does not hold snapshot ONE"):
        snapshot.open_session()
    assert not list((tmp_path / "store").iterdir())
