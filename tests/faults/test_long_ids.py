"""Ids longer than a file's name may be: what is published and exported has names that every file system takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.features import safe_file_stem
from catalogs.query.execution import query
from tasks.engine.run import Run
from tasks.export.formats import export_run
from tests.faults.conftest import LONG


def test_names_made_of_ids_are_bounded_and_tell_ids_apart() -> None:
    ids = ["a" * 120, "a" * 121, "a" * 300, "a" * 300 + "b", "ä" * 300, "a/b", "a\udcffb", "\ud800" * 300]
    stems = [safe_file_stem(one) for one in ids]
    assert stems[0] == ids[0]
    assert max(len(stem.encode()) for stem in stems) <= 120
    assert len(set(stems)) == len(ids)


@pytest.mark.parametrize("style", ["glb", "labelme", "gpkg"])
def test_a_building_and_a_street_with_such_an_id_are_published_and_exported(
    textured: tuple[Path, Run], tmp_path: Path, style: str
) -> None:
    out = Path(textured[1].out)
    names = [path.name for path in (out / "published").rglob("*")]
    assert sum(name.startswith(LONG[:80]) for name in names) >= 2
    assert LONG in query(out)["building"].tolist()
    done = export_run(out, style, tmp_path / ("all.gpkg" if style == "gpkg" else style), ())
    assert done.files
