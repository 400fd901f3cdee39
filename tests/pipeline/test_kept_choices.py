"""One change restyles no other house; a restyled block is as fresh."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar_set
from catalogs.block.corrections import Correction, append_corrections_to_file
from facade_core.atlas.journal import Record
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.status import completion_summary
from tasks.publish.task import publish_block
from tasks.stages.facades.exemplar_choices import delete_exemplar_choices
from tests.pipeline.stages import charts_of, digests_of, redone, started, texture, write_block

pytestmark = pytest.mark.long

# A row of houses along one street, none touching another.
HOUSES = {name: (13.0 * i, 5.0, 10.0, 2.8, 7.0 + i % 3) for i, name in enumerate("abcdef")}
STREET = {"1": [(0, 0), (78, 0)]}
EXEMPLARS = 12


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The row textured from exemplars."""
    folder = tmp_path_factory.mktemp("row")
    (folder / "in" / "exemplars").mkdir(parents=True)
    for number, painted in enumerate(paint_exemplar_set(EXEMPLARS, seed=5, metres_per_pixel=0.2)):
        Image.fromarray(painted.image).save(folder / "in" / "exemplars" / f"{number}.png")
    texture(write_block(folder / "in", buildings=HOUSES, streets=STREET), folder / "out")
    return folder


@pytest.fixture
def folder(row: Path, tmp_path: Path) -> Path:
    """A copy of the row."""
    shutil.copytree(row, tmp_path / "copy")
    return tmp_path / "copy"


def facades(folder: Path) -> dict[str, Record]:
    return {one["unit"]: one for one in read_newest_journal(folder / "out" / "store", "facades") if one}


def of_house(names: set[str] | dict[str, Record]) -> set[str]:
    return {name.partition("-")[0] for name in names}


def differing(before: dict[str, Record], after: dict[str, Record]) -> set[str]:
    """The facades whose textures differ."""
    return {name for name in before.keys() | after.keys() if _digests(before, name) != _digests(after, name)}


def _digests(records: dict[str, Record], name: str) -> object:
    return records[name]["digests"] if name in records else None


def test_one_height_makes_one_house_pending(folder: Path) -> None:
    block, before, held = folder / "in" / "block.yaml", facades(folder), started(folder / "out")
    append_corrections_to_file(block, [Correction("f", "height", 22.0)])
    texture(block, folder / "out")
    after = facades(folder)
    assert of_house({unit for stage, unit in redone(held, folder / "out") if stage == "facades"}) == {"f"}
    assert of_house(differing(before, after)) == {"f"}
    fresh = texture(block, folder / "fresh")
    again = {one["unit"]: one for one in read_newest_journal(fresh.run.store, "facades") if one}
    assert of_house(differing(after, again)) - {"f"}, "a fresh run chooses anew for others too"
    delete_exemplar_choices(texture(block, folder / "out").run)
    run = texture(block, folder / "out").run
    assert differing(again, facades(folder)) == set(), "a restyled block is as fresh"
    assert digests_of(folder / "out") == digests_of(folder / "fresh")
    charts, others = charts_of(run), charts_of(fresh.run)
    assert all((charts[chart][0] == others[chart][0]).all() for chart in others)


def test_a_removed_exemplar_changes_its_own_walls(folder: Path) -> None:
    block, before, held = folder / "in" / "block.yaml", facades(folder), started(folder / "out")
    gone = str(before["c-0"]["source"])  # type: ignore[typeddict-item]
    (folder / "in" / "exemplars" / f"{gone.partition(',')[0]}.png").unlink()
    texture(block, folder / "out")
    users = {name for name, one in before.items() if one["source"] == gone}  # type: ignore[typeddict-item]
    assert {unit for stage, unit in redone(held, folder / "out") if stage == "facades"} == users
    assert users < before.keys()


def test_other_density_keeps_the_choices(folder: Path) -> None:
    block = folder / "in" / "block.yaml"
    append_corrections_to_file(block, [Correction("b", "height", 22.0)])
    texture(block, folder / "out")
    sources = {name: one["source"] for name, one in facades(folder).items()}  # type: ignore[typeddict-item]
    write_block(folder / "in", buildings=HOUSES, streets=STREET, texture={"texels_per_metre": 2.5})
    texture(block, folder / "out")
    assert {name: one["source"] for name, one in facades(folder).items()} == sources  # type: ignore[typeddict-item]


def test_restyling_a_finished_block_publishes_it_again(folder: Path) -> None:
    block = folder / "in" / "block.yaml"
    run = texture(block, folder / "out").run
    publish_block.fn(run)
    assert completion_summary(run) is not None
    delete_exemplar_choices(replace(run, out=f"{run.out}-to-come"))
    delete_exemplar_choices(run)
    assert completion_summary(run) is None
    held = started(folder / "out")
    texture(block, folder / "out")
    publish_block.fn(run)
    assert redone(held, folder / "out") == set(), "the choices of a block that did not change are those of before"
    assert completion_summary(run) is not None
