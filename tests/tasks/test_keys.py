"""Keys of units tell what changed."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from catalogs.block_digest import file_digest
from tasks.carry import _by_key, _streets
from tasks.keys import changed_parts, parts_key


def test_keys_differ_in_the_parts_that_changed() -> None:
    one = parts_key(settings=[1, 2.0], photo="a", geometry={"b": 1})
    assert parts_key(settings=[1, 2.0], photo="a", geometry={"b": 1}) == one
    assert changed_parts(one, parts_key(settings=[1, 2.5], photo="b", geometry={"b": 1})) == ["photo", "settings"]
    assert changed_parts(one, parts_key(settings=[1, 2.0], exemplar="a", geometry={"b": 1})) == ["exemplar", "photo"]
    assert changed_parts(one, one) == []


def test_a_file_is_read_again_when_it_changed(tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    path.write_bytes(b"one")
    first = file_digest(path)
    assert file_digest(path) == first
    path.write_bytes(b"two")
    state = path.stat()
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns + 1))
    assert file_digest(path) != first
    path.write_bytes(b"one")
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns + 2))
    assert file_digest(path) == first


def test_units_are_found_again_by_their_keys() -> None:
    records = [{"key": "a"}, None, {"key": "c"}]
    assert _by_key(records, ["c", "b", "a"]) == {0: 2, 2: 0}


def test_streets_are_found_again_by_line_and_then_by_id() -> None:
    from types import SimpleNamespace as Value
    from typing import Any

    import shapely

    def plan(**lines: float) -> Any:
        streets = [Value(id=name, line=shapely.LineString([(0, y), (9, y)])) for name, y in lines.items()]
        return Value(streets=tuple(streets), wave=np.zeros(len(streets)))

    assert _streets(plan(g0=0, g1=1, g2=2), plan(g0=1, g1=2)) == {0: 1, 1: 2}  # named anew since one is gone
    assert _streets(plan(a=0, b=1), plan(a=0.5, b=1, c=2)) == {0: 0, 1: 1}  # a was moved
