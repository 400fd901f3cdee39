"""What training the translator refuses before it renders anything."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from facade_core.core.errors import InputError, ModelFileError
from facade_core.street.translator import training
from facade_core.street.translator.training import SMALL_RECIPE
from tasks.engine.store.status import record_run_block_file
from tasks.training.translator import (
    PanoramaSplitPrefixes,
    list_pictures,
    read_panorama_sets,
    read_run_panoramas,
    train_translator,
)

BLOCKS = Path(__file__).parents[3] / "catalogs" / "examples" / "blocks"


def test_without_torch_it_ends_before_anything_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "find_spec", lambda name: None)
    places = PanoramaSplitPrefixes(("nowhere",))
    with pytest.raises(ModelFileError, match="make train-setup"):
        train_translator(
            [tmp_path / "none"], [tmp_path / "none.yaml"], tmp_path / "out", seed=0, recipe=SMALL_RECIPE, split=places
        )
    assert not any(tmp_path.iterdir())


def test_panoramas_are_split_by_place_and_pictures_of_other_shapes_are_not_taken(tmp_path: Path) -> None:
    for name, size in {"here_1": (64, 32), "there_1": (64, 32), "out_1": (64, 32), "photo": (64, 48)}.items():
        Image.new("RGB", size, (90, 120, 150)).save(tmp_path / f"{name}.png")
    learnt, judged, names = read_panorama_sets(list_pictures([tmp_path]), PanoramaSplitPrefixes(("there",), ("out",)))
    assert (len(learnt), len(judged), names) == (1, 1, [f"{tmp_path.name}/here_1.png"])
    with pytest.raises(InputError, match=r"2 panoramas .* to learn from and 0 to judge by"):
        read_panorama_sets(list_pictures([tmp_path]), PanoramaSplitPrefixes(("nowhere",), ("out",)))
    learnt, judged, names = read_panorama_sets(list_pictures([tmp_path]), PanoramaSplitPrefixes())
    assert (len(learnt), len(judged)) == (2, 1), "the last fifth judges"


@pytest.mark.realdata
def test_a_run_has_its_cameras_and_its_block(tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STREETLOOM_DATA", str(data))
    block = BLOCKS / "amsterdam-ij.yaml"
    record_run_block_file(tmp_path, block)
    street = read_run_panoramas(tmp_path)
    assert street.block == block
    assert [name for name, _ in street.pictures] == [f"{tmp_path.name}/{path.name}" for _, path in street.pictures]
    learnt, judged, names = read_panorama_sets(street.pictures, PanoramaSplitPrefixes())
    assert len(learnt) == len(names) > 0 < len(judged)


@pytest.mark.realdata
def test_a_folder_of_no_run_and_a_run_without_cameras_are_told(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STREETLOOM_DATA", str(data))
    with pytest.raises(InputError, match="no run of a block"):
        read_run_panoramas(tmp_path)
    record_run_block_file(tmp_path, BLOCKS / "helsinki.yaml")
    with pytest.raises(InputError, match=r"helsinki.yaml: its imagery has no panoramas"):
        read_run_panoramas(tmp_path)
