"""A street done again: with the later ones that read its texels, or alone."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalogs.query import query
from facade_core.errors import InputError
from tasks.commits import journal
from tasks.streets import find_redo, street_chunks
from tests.pipeline.runs import ROOT, command, environment


def redo(block: Path, out: Path, *options: str) -> tuple[dict[str, Any], str]:
    done = subprocess.run(
        [*command(block, out, 1), *options],
        cwd=ROOT,
        env=environment(out.parent),
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.strip().splitlines()[-1]), done.stderr


def test_a_street_done_again_alone_leaves_the_others_stale_until_the_next_run(block, undisturbed, tmp_path) -> None:
    before, summary = undisturbed
    out = tmp_path / "out"
    shutil.copytree(before, out)
    records = journal(out / "store", "streets")
    first = next(r for r in records if r and r["wave"] == 0 and r["digests"])
    later = [r["unit"] for r in records if r and r["wave"] > 0 and set(r["digests"]) & set(first["digests"])]
    assert later
    alone, told = redo(block, out, "--redo", first["unit"], "--only")
    assert first["unit"] in told
    assert all(unit in told for unit in later)
    states = {r["unit"]: r["status"] for r in journal(out / "store", "streets") if r}
    assert states[first["unit"]] == "done"
    assert {unit for unit, state in states.items() if state == "stale"} >= set(later)
    rows = query(out, where="kind = 'street'")
    assert set(rows["id"]) == {unit for unit, state in states.items() if state == "stale"}
    assert alone["atlas_digest"] == summary["atlas_digest"]
    mended, _ = redo(block, out)
    assert {r["status"] for r in journal(out / "store", "streets") if r} == {"done"}
    assert mended["atlas_digest"] == summary["atlas_digest"]
    assert query(out, where="kind = 'street'").empty


class Blocked:
    """A plan of three streets in three waves on three charts: each writes its own and reads the one before it."""

    class _Cells:
        @staticmethod
        def chunks(chart: int, chunk: int, gutter: int) -> np.ndarray:
            return np.array([[0, 0, chart]])

    def __init__(self) -> None:
        from types import SimpleNamespace as Value

        self.scene = Value(spec=Value(chunk=128, gutter=2), placement=self._Cells())
        self.streets = tuple(Value(id=name, name=None) for name in "abc")
        self.wave = np.arange(3)
        self.writable = np.array([True, True, True])
        self.views = np.array([[0, 0], [1, 0], [1, 1], [2, 1], [2, 2]])

        self.street_charts = self.views


def test_whoever_reads_what_is_written_again_depends_through_others_too() -> None:
    plan: Any = Blocked()
    assert street_chunks(plan, 1) == ({"0/0/0", "0/0/1"}, {"0/0/0", "0/0/1"})
    assert find_redo(plan, "a").dependants == (1, 2)
    assert find_redo(plan, "b").dependants == (2,)
    assert find_redo(plan, "c").dependants == ()
    with pytest.raises(InputError, match="no street has the id or name 'd'"):
        find_redo(plan, "d")
