"""Blocks of a city share the exemplars that one of them prepared."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from catalogs.block.reader import read_block
from facade_core.atlas.store import create_root, open_repository, open_root
from facade_core.core.errors import ImageError
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.unit import Unit
from tasks.stages.exemplars import worker
from tasks.stages.exemplars.shared import read_shared_exemplar
from tasks.stages.exemplars.stage import EXEMPLARS
from tests.pipeline.stages import write_block


@pytest.fixture
def prepared_counts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry for each exemplar that is prepared and not read."""
    calls: list[int] = []
    prepare = worker.prepare_exemplar

    def count_and_prepare(*args: Any, **more: Any) -> Any:
        calls.append(1)
        return prepare(*args, **more)

    monkeypatch.setattr(worker, "prepare_exemplar", count_and_prepare)
    return calls


def process_first(block_file: Path, out: Path) -> tuple[Run, Unit[Any], dict[str, Any], dict[str, np.ndarray]]:
    """Prepare the first exemplar of a block into a folder: its run, unit, record and arrays."""
    block = read_block(block_file)
    run = create_run(block, out)
    session = open_repository(out / "store", create=True).writable_session("main")
    create_root(session)
    session.commit("root")
    session = open_repository(out / "store").writable_session("main")
    unit = EXEMPLARS.list_units(run, block, None, None)[0]  # type: ignore[arg-type]
    fork, records = worker.process_exemplar(run, session.fork(), (unit,))
    group = open_root(fork)[str(dict(records[0])["folder"])]
    return run, unit, dict(records[0]), {name: group[name][:] for name in ("image", "labels", "preview")}


def in_city(folder: Path, name: str) -> Path:
    (folder / "blocks" / name).mkdir(parents=True)
    (folder / "city.json").touch()
    return folder / "blocks" / name


def differing(one: dict[str, Any], other: dict[str, Any]) -> set[str]:
    return {name for name in one if one[name] != other[name]} - {"started", "seconds", "worker"}


def test_the_second_block_of_a_city_reads_what_the_first_prepared(tmp_path: Path, prepared_counts: list[int]) -> None:
    block = write_block(tmp_path / "in")
    run, unit, record, arrays = process_first(block, in_city(tmp_path / "city", "a"))
    assert len(prepared_counts) == 1
    _, _, again, same = process_first(block, in_city(tmp_path / "city", "b"))
    assert len(prepared_counts) == 1
    assert record.keys() == again.keys()
    assert not differing(record, again)
    assert all(np.array_equal(arrays[name], same[name]) for name in arrays)
    assert read_shared_exemplar(run, unit) is not None


def test_a_changed_setting_prepares_it_again(tmp_path: Path, prepared_counts: list[int]) -> None:
    process_first(write_block(tmp_path / "in"), in_city(tmp_path / "city", "a"))
    finer = write_block(tmp_path / "in", texture={"texels_per_metre": 4})
    process_first(finer, in_city(tmp_path / "city", "b"))
    assert len(prepared_counts) == 2


def test_a_block_alone_shares_nothing(tmp_path: Path, prepared_counts: list[int]) -> None:
    block = write_block(tmp_path / "in")
    for name in ("a", "b"):
        out = tmp_path / "blocks" / name
        out.mkdir(parents=True)
        run, unit, _, _ = process_first(block, out)
        assert (run.shared, read_shared_exemplar(run, unit)) == ("", None)
    assert len(prepared_counts) == 2


def test_a_damaged_file_is_prepared_again(tmp_path: Path, prepared_counts: list[int]) -> None:
    block = write_block(tmp_path / "in")
    process_first(block, in_city(tmp_path / "city", "a"))
    (file,) = (tmp_path / "city" / "shared" / "exemplars").iterdir()
    file.write_bytes(file.read_bytes()[:2000])
    run, unit, _, _ = process_first(block, in_city(tmp_path / "city", "b"))
    assert len(prepared_counts) == 2
    assert read_shared_exemplar(run, unit) is not None


def test_an_exemplar_that_is_not_rectified_is_refused(tmp_path: Path) -> None:
    block_file = write_block(tmp_path / "in")
    path = read_block(block_file).exemplars[0]
    picture = cv2.imread(str(path))
    height, width = picture.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    from_the_left = corners + np.array([[0, 0], [0, 0.25], [0, -0.15], [0, 0]], np.float32) * height
    turn = cv2.getPerspectiveTransform(corners, from_the_left)
    cv2.imwrite(str(path), cv2.warpPerspective(picture, turn, (width, height), borderMode=cv2.BORDER_REPLICATE))
    with pytest.raises(ImageError, match=r"slope by \d+ degrees; it is not rectified: `streetloom harvest`"):
        process_first(block_file, tmp_path / "out")
