"""What an earlier snapshot has of the same is linked, whatever else is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from catalogs.published.file_list import find_snapshot_damage, write_file_list
from catalogs.published.reuse import SnapshotFileWriter


def never() -> bytes:
    raise AssertionError("it is made again")


def publish_snapshot(
    folder: Path, earlier: Path | None, **files: tuple[str, Callable[[], bytes]]
) -> SnapshotFileWriter:
    folder.mkdir()
    made = SnapshotFileWriter(folder, earlier)
    for name, (of, data) in files.items():
        made.add_file(f"pages/{name}", of, data)
    write_file_list(folder, None, source_digests=made.source_digests, known=made.linked)
    return made


def is_linked(name: str, *folders: Path) -> bool:
    return len({(folder / "pages" / name).stat().st_ino for folder in folders}) == 1


def test_what_is_made_of_the_same_is_linked(tmp_path: Path) -> None:
    first, second, third = (tmp_path / name for name in ("1", "2", "3"))
    publish_snapshot(first, None, a=("x", lambda: b"old"), b=("y", lambda: b"same"))
    made = publish_snapshot(second, first, a=("x2", lambda: b"new"), b=("y", never))
    assert (second / "pages" / "a").read_bytes() == b"new"
    assert (first / "pages" / "a").read_bytes() == b"old"
    assert is_linked("b", first, second)
    assert list(made.linked) == ["pages/b"]
    publish_snapshot(third, second, a=("x2", never), b=("y", never))
    assert is_linked("b", first, second, third)
    assert find_snapshot_damage(third, thorough=True) is None


def test_what_is_lost_cut_or_garbled_is_made_again(tmp_path: Path) -> None:
    first, second = tmp_path / "1", tmp_path / "2"
    publish_snapshot(first, None, **{name: (name, lambda: b"whole") for name in ("kept", "lost", "cut", "garbled")})
    (first / "pages" / "lost").unlink()
    (first / "pages" / "cut").write_bytes(b"who")
    (first / "pages" / "garbled").write_bytes(b"\0" * 5)
    made = publish_snapshot(
        second,
        first,
        **{name: (name, lambda: b"whole") for name in ("kept", "lost", "cut", "garbled")},
    )
    assert set(made.linked) == {"pages/kept"}
    assert {path.read_bytes() for path in (second / "pages").iterdir()} == {b"whole"}


def test_what_could_not_be_published_is_amiss(tmp_path: Path) -> None:
    write_file_list(tmp_path, None)
    assert find_snapshot_damage(tmp_path) is None
    write_file_list(tmp_path, None, failures={"report": "no room"})
    assert find_snapshot_damage(tmp_path) == "report could not be published: no room"
