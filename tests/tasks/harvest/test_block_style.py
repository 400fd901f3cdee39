"""Harvest of a block's street pictures as part of its run; the facades of pictures are the test's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar
from catalogs.block.reader import Block, read_block
from catalogs.city.keys import validate_city_settings
from catalogs.published.s3 import folder_at
from facade_core.core.errors import InputError
from tasks.engine.run_key import create_run
from tasks.harvest.block_style import harvest_block_style, list_harvested_exemplars
from tests.pipeline.stages import write_block
from tests.tasks.harvest.test_library import SCALE, harvested

__all__ = ["harvested"]


@pytest.fixture
def block(tmp_path: Path) -> Block:
    """A block with two given exemplars, 0 and 1, and three street pictures, of which one is named 0 and one is plain."""
    pictures = tmp_path / "street"
    pictures.mkdir()
    for name, index in (("a", 0), ("0", 1)):
        Image.fromarray(paint_exemplar(index, seed=7, metres_per_pixel=SCALE).image).save(pictures / f"{name}.png")
    Image.fromarray(np.full((90, 120, 3), 90, np.uint8)).save(pictures / "plain.png")
    write_block(tmp_path)
    imagery = {"exemplars": {"path": "exemplars"}, "style": {"path": "street"}}
    return read_block(write_block(tmp_path, imagery=imagery))


def harvest(block: Block, out: Path, said: list[str]) -> Block:
    return harvest_block_style(block, out, workers=1, dask=None, notify=said.append)


def test_harvested_exemplars_follow_the_given_ones_and_are_harvested_once(
    block: Block, tmp_path: Path, harvested: list[tuple[int, ...]]
) -> None:
    out, said = tmp_path / "out", list[str]()
    found = harvest(block, out, said)
    assert [path.stem for path in found.exemplars] == ["0", "1", "a"]
    assert found.exemplars[2] == out / "style" / "a.png"
    assert found.digest == block.digest
    assert [path.stem for path in list_harvested_exemplars(out)] == ["0", "a"]
    assert said[0] == "style: 0 is left out: an exemplar of the block has this name; rename the picture"
    assert said[1].startswith("style: 1 exemplar of 3 pictures; ")
    harvested.clear()
    assert harvest(block, out, said).exemplars == found.exemplars
    assert harvested == []


def test_a_run_states_that_faces_and_plates_were_not_looked_for(
    block: Block, tmp_path: Path, harvested: list[tuple[int, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[str]()
    monkeypatch.setattr("tasks.harvest.task.detectors_available", lambda: False)
    harvest(block, tmp_path / "out", said)
    assert sum(line.startswith("style: faces and number plates were not detected") for line in said) == 1


def test_a_run_states_that_exemplars_are_of_low_score(
    block: Block, tmp_path: Path, harvested: list[tuple[int, ...]]
) -> None:
    for path in (tmp_path / "street").iterdir():
        Image.fromarray(np.asarray(Image.open(path)) // 3).save(path)
    said = list[str]()
    found = harvest(read_block(tmp_path / "block.yaml"), tmp_path / "out", said)
    assert [path.stem for path in found.exemplars] == ["0", "1", "a"]
    assert sum("1 of the exemplars is below the usual score" in line for line in said) == 1


def test_a_block_without_street_pictures_is_as_before(block: Block, tmp_path: Path) -> None:
    given = read_block(write_block(tmp_path))
    assert harvest(given, tmp_path / "out", []) is given
    assert given.digest != block.digest


def test_the_pictures_determine_the_digest_and_the_run(block: Block, tmp_path: Path) -> None:
    Image.fromarray(np.full((90, 120, 3), 91, np.uint8)).save(tmp_path / "street" / "plain.png")
    changed = read_block(tmp_path / "block.yaml")
    assert changed.digest != block.digest
    assert create_run(changed, tmp_path / "out").key != create_run(block, tmp_path / "out").key


def test_statistics_are_of_every_usable_facade(block: Block, tmp_path: Path, harvested: list[tuple[int, ...]]) -> None:
    harvest(block, tmp_path / "out", [])
    statistics = json.loads((tmp_path / "out" / "style" / "statistics.json").read_text())
    assert statistics["facades"] == 2
    assert sum(each["share"] for each in statistics["materials"].values()) == 1
    assert statistics["floors"] == [3, 3, 3]
    assert statistics["with_shops"] == 0
    assert 0 < statistics["window_share"][1] < 0.1


def test_a_style_without_a_usable_facade_ends_the_run(tmp_path: Path, harvested: list[tuple[int, ...]]) -> None:
    (tmp_path / "street").mkdir()
    Image.fromarray(np.full((90, 120, 3), 90, np.uint8)).save(tmp_path / "street" / "plain.png")
    alone = read_block(write_block(tmp_path, imagery={"style": {"path": "street"}}))
    with pytest.raises(InputError, match=r"imagery\.style: no facade can be used; add photos"):
        harvest(alone, tmp_path / "out", [])


def test_a_cluster_and_a_bucket_are_refused_together(block: Block) -> None:
    with pytest.raises(InputError, match=r"imagery\.style: workers of a cluster do not see"):
        harvest_block_style(
            block, folder_at("s3://bucket/run"), workers=1, dask="tcp://127.0.0.1:1", notify=lambda line: None
        )


def test_a_city_is_to_be_harvested_once(tmp_path: Path) -> None:
    values = {
        "name": "a",
        "buildings": {"path": "a.geojson"},
        "streets": {"path": "s.geojson"},
        "imagery": {"style": {"path": "street"}},
    }
    with pytest.raises(
        ValueError, match=r"imagery\.style: each block would harvest the same pictures; run `streetloom"
    ):
        validate_city_settings(values, tmp_path / "city.yaml")
