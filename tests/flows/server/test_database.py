"""An empty database is kept once and laid out for every later run."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from flows.server import database as server_database


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder


def created(home: Path) -> Path:
    home.mkdir()
    with closing(sqlite3.connect(home / "prefect.db")) as database:
        database.execute("create table flow (id text)")
        database.commit()
    return home


def test_what_one_run_created_the_next_one_finds(tmp_path: Path) -> None:
    (tmp_path / "next").mkdir()
    assert not server_database.restore_database(tmp_path / "next")
    server_database.cache_database(created(tmp_path / "first"))
    assert server_database.restore_database(tmp_path / "next")
    with closing(sqlite3.connect(tmp_path / "next" / "prefect.db")) as database:
        assert database.execute("select name from sqlite_master").fetchall() == [("flow",)]


def test_a_run_goes_on_with_its_own(tmp_path: Path) -> None:
    server_database.cache_database(created(tmp_path / "first"))
    own = created(tmp_path / "own")
    with closing(sqlite3.connect(own / "prefect.db")) as database:
        database.execute("create table own (id text)")
        database.commit()
    held = (own / "prefect.db").read_bytes()
    assert server_database.restore_database(own)
    assert (own / "prefect.db").read_bytes() == held


def test_where_nothing_can_be_kept_nothing_is_said(tmp_path: Path, cache: Path) -> None:
    cache.write_text("a file where the folder would be")
    server_database.cache_database(created(tmp_path / "first"))
    server_database.cache_database(tmp_path / "without")
    (tmp_path / "next").mkdir()
    assert not server_database.restore_database(tmp_path / "next")


def test_a_cut_database_counts_as_none(tmp_path: Path, cache: Path) -> None:
    server_database.cache_database(created(tmp_path / "first"))
    (kept,) = (cache / "streetloom").iterdir()
    own = created(tmp_path / "own") / "prefect.db"
    own.write_bytes(own.read_bytes()[:4096])
    assert server_database.restore_database(own.parent), "the cached one takes its place"
    assert own.read_bytes() == kept.read_bytes()
    kept.write_bytes(kept.read_bytes()[:4096])
    own.unlink()
    assert not server_database.restore_database(own.parent)
    assert list(own.parent.iterdir()) == []
