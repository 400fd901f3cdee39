"""After a change, what depends on it is done again and nothing else, and each texture is that of a fresh run."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from PIL import Image, ImageOps

from catalogs.block.corrections import Correction, append_corrections_to_file
from catalogs.block.reader import read_block
from facade_core.atlas.journal import Record, read_journal
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.provenance import Provenance
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan_tables import read_plan
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.context import load_run_plan
from tasks.engine.fan_out import process_batch
from tasks.engine.forecast import NOTHING_PENDING
from tasks.engine.run_key import create_run
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.digests import find_differing_units
from tasks.engine.store.integrity import find_lost_units
from tasks.engine.store.status import completion_summary
from tasks.publish.task import publish_block
from tasks.stages.exemplars.record import ExemplarRecord
from tasks.stages.facades.exemplar_choices import delete_exemplar_choices
from tasks.stages.surfaces.stage import SURFACES
from tests.pipeline.painted_panoramas import CAMERAS, FAR, PICTURED, write_panoramas
from tests.pipeline.stages import (
    BUILDINGS,
    STREETS,
    Textured,
    charts_of,
    digests_of,
    redone,
    started,
    texture,
    write_block,
    write_photo,
)

pytestmark = pytest.mark.long

Again = Callable[..., tuple[set[str], Textured]]
ALL_STREETS = {"s1", "s2", "s3"}
# Stages whose units follow from what the others do.
FOLLOW = ("surfaces", "pages", "tiles", "pictures")
PLAIN: dict[str, Any] = {"texture": {"walls": "translate"}}
# A house that panoramas do not show; of the streets, only the third sees it.
FAR_HOUSE = {"f": (70.0, 604.0, 12.0, 2.8, 7.0)}


@pytest.fixture(scope="module")
def seeded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The block with exemplars, and a photo of one facade."""
    folder = tmp_path_factory.mktemp("seeded")
    write_photo(folder / "in", "a-0", 1)
    texture(write_block(folder / "in"), folder / "out")
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The block without any pictures: its streets have nothing to do."""
    folder = tmp_path_factory.mktemp("plain")
    texture(write_block(folder / "in", **PLAIN), folder / "out")
    return folder


def again(folder: Path) -> tuple[set[str], Textured]:
    """Run the block in a folder again: the units that were done, but those that follow from others, and what was said."""
    before = started(folder / "out")
    made = texture(folder / "in" / "block.yaml", folder / "out")
    return {unit for stage, unit in redone(before, folder / "out") if stage not in FOLLOW}, made


def surfaces_since(before: dict[tuple[str, str], float], folder: Path) -> set[str]:
    """The buildings that were finished again, and "ground" where some ground was."""
    return {unit.partition("-")[0] for stage, unit in redone(before, folder / "out") if stage == "surfaces"}


def copied(folder: Path, to: Path) -> Path:
    shutil.copytree(folder, to / "copy")
    return to / "copy"


def assert_as_fresh(folder: Path, made: Textured) -> None:
    """Every chart has the colour and provenance that a run in an empty folder gives it, bit for bit."""
    fresh = texture(folder / "in" / "block.yaml", folder / "fresh", stop_before="pages")  # which hold the same texels
    assert fresh.said is None
    one, other = charts_of(made.run), charts_of(fresh.run)
    assert one.keys() == other.keys()
    for chart, arrays in other.items():
        for mine, theirs in zip(one[chart], arrays, strict=True):
            np.testing.assert_array_equal(mine, theirs)
    assert digests_of(folder / "out") == digests_of(folder / "fresh")


def test_with_nothing_changed_nothing_is_done(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    done, made = again(folder)
    assert done == set()
    assert made.said == NOTHING_PENDING


def test_a_building_raised(plain: Path, tmp_path: Path) -> None:
    folder = copied(plain, tmp_path)
    write_block(folder / "in", buildings=BUILDINGS | {"c": (*BUILDINGS["c"][:4], 9.0)}, **PLAIN)
    done, made = again(folder)
    assert done == {"c-0"}
    assert (made.said or "").startswith("pending: 1 of 6 facades (geometry changed), ")
    assert (made.said or "").endswith("; walls change at 1 of 5 buildings (c)")
    assert_as_fresh(folder, made)


def test_a_building_that_one_street_sees(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    write_block(folder / "in", buildings=BUILDINGS | FAR_HOUSE, **PICTURED)
    done, made = again(folder)
    assert done == {"c-1.jpg", "s3"}
    assert "1: visible surfaces changed" in (made.said or "")
    assert_as_fresh(folder, made)


def test_a_building_removed_and_another_added(plain: Path, tmp_path: Path) -> None:
    folder = copied(plain, tmp_path)
    fewer = {name: box for name, box in BUILDINGS.items() if name != "d"}
    write_block(folder / "in", buildings=fewer, **PLAIN)
    done, _ = again(folder)
    assert done == set()
    places = dict(zip(*_places(folder), strict=True))
    write_block(folder / "in", buildings={"0": (20.0, 605, 9, 2.8, 8.0), **fewer}, **PLAIN)
    done, made = again(folder)
    assert done == {"0-0"}
    kept = dict(zip(*_places(folder), strict=True))
    walls = {chart for chart in places if chart in kept}
    assert len(walls) > 30
    assert all(kept[chart] == places[chart] for chart in walls)
    assert_as_fresh(folder, made)


def test_settings_reach_what_reads_them(plain: Path, tmp_path: Path) -> None:
    folder = copied(plain, tmp_path)
    write_block(folder / "in", **PLAIN, storey=3.4, geoid_separation=17.0)
    assert again(folder)[0] == set()
    before = started(folder / "out")
    write_block(folder / "in", texture=PLAIN["texture"] | {"levelling": False})
    assert again(folder)[0] == set()
    assert surfaces_since(before, folder) == {*BUILDINGS, "ground"}


def test_other_viewpoints_are_another_street(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    write_block(folder / "in", **PICTURED | {"texture": PICTURED["texture"] | {"viewpoint_spacing": 8.0}})
    done, made = again(folder)
    assert done == ALL_STREETS
    assert (made.said or "").startswith("pending: 3 of 3 streets (visible surfaces changed), ")
    assert_as_fresh(folder, made)


def test_a_surface_that_fails_leaves_nothing_of_before(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    block, made = read_block(folder / "in" / "block.yaml"), texture(folder / "in" / "block.yaml", folder / "out")
    plan, before = load_run_plan(made.run), charts_of(made.run)
    group = open_root(open_repository(made.run.store).readonly_session(BRANCH))
    [unit] = [unit for unit in SURFACES.list_units(made.run, block, plan, group) if unit.name == "a"]

    def fails(*_: Any) -> None:
        raise ValueError("no material")

    [(name, reason)] = process_batch.fn(made.run, "surfaces", "1", fails, [[unit]], SerialCompute()).failed
    assert name == "a"
    assert reason.startswith("stopped by an error of its own (ValueError: no material); ")
    own = {f"{number:016x}" for number in plan.ids[list(unit.charts)].tolist()}
    for chart, (colour, provenance) in charts_of(made.run).items():
        if chart in own:
            assert not colour.any()
            assert not provenance.any()
        else:
            np.testing.assert_array_equal(provenance, before[chart][1])
    again(folder)
    assert_as_fresh(folder, made)


def test_a_street_that_goes_takes_its_texels_along(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    write_block(folder / "in", streets={name: line for name, line in STREETS.items() if name != "2"}, **PICTURED)
    done, made = again(folder)
    assert "c-1.jpg" not in done
    assert_as_fresh(folder, made)


def test_a_panorama_changed_reaches_streets(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    write_panoramas(folder / "in", CAMERAS | {"c-1": (10.5, FAR - 1, CAMERAS["c-1"][2])})
    done, made = again(folder)
    assert done >= ALL_STREETS, "material of ground is learnt from all that is pictured"
    assert "a-1.jpg" not in done
    assert "3 of 3 streets (their inputs are pending)" in (made.said or "")
    assert_as_fresh(folder, made)


def test_a_street_without_its_panorama_shows_its_material(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    assert all(views_of(folder).values())
    assert Provenance.TRANSLATED in provenance_beside_street_3(pictured)
    (folder / "in" / "panoramas" / "c-1.jpg").unlink()
    write_panoramas(folder / "in", {"a-1": CAMERAS["a-1"]})
    _, made = again(folder)
    views = views_of(folder)
    assert views["s1"]
    assert views["s3"] == {}
    assert Provenance.TRANSLATED not in provenance_beside_street_3(folder)
    assert_as_fresh(folder, made)


def views_of(folder: Path) -> dict[str, Mapping[str, str]]:
    """Return what the store holds of the viewpoints of each street, path -> digest."""
    return {r["unit"]: r.get("files", {}) for r in read_newest_journal(folder / "out" / "store", "streets") if r}


def provenance_beside_street_3(folder: Path) -> set[int]:
    """Return the sources of the texels of the ground that only street 3 shows."""
    session = open_repository(folder / "out" / "store").readonly_session(BRANCH)
    group, plan = open_root(session), read_plan(session)
    charts = plan.charts_of_street([one.id for one in plan.streets].index("s3"))
    ground = charts[plan.scene.charts.kind[charts] == ChartKind.GROUND].tolist()
    flat = read_rasters(
        group["atlas/provenance"], plan.scene.placement, TexelLayout.of_charts(plan.scene.placement, ground)
    )
    return set(np.unique(flat).tolist())


def test_a_street_whose_id_goes_to_another_line(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    write_block(folder / "in", streets={**STREETS, "1": [(60, -15), (60, 25)], "4": STREETS["1"]}, **PICTURED)
    _, made = again(folder)
    assert_as_fresh(folder, made)


def test_two_exemplars_of_one_name_are_two(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    exemplars = folder / "in" / "exemplars"
    ImageOps.mirror(Image.open(exemplars / "0.png")).save(exemplars / "0.bmp")
    delete_exemplar_choices(create_run(read_block(folder / "in" / "block.yaml"), folder / "out"))
    _, made = again(folder)
    assert_as_fresh(folder, made)
    session = open_repository(made.run.store).readonly_session(BRANCH)
    folders = [record["folder"] for record in read_journal(open_root(session), "exemplars", ExemplarRecord) if record]
    assert len(set(folders)) == 3
    assert find_differing_units(open_root(session), load_run_plan(made.run)) == find_lost_units(session) == {}


def test_a_run_that_stops_halfway_goes_on(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    block = write_block(folder / "in", buildings=BUILDINGS | FAR_HOUSE, **PICTURED)
    before = started(folder / "out")
    texture(block, folder / "out", stop_before="streets")
    halfway = {unit for stage, unit in redone(before, folder / "out") if stage not in FOLLOW}
    assert halfway == {"c-1.jpg"}
    done, made = again(folder)
    assert done == {"s3"}
    assert_as_fresh(folder, made)


def walls_of(house: str) -> set[str]:
    """The facades of one of the block's houses: one at a street, three on none."""
    return {f"{house}-{wall}" for wall in range(4)}


def records_of(folder: Path) -> dict[str, Record]:
    return {r["unit"]: r for r in read_newest_journal(folder / "out" / "store", "facades") if r}


def test_a_photo_changed(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    write_photo(folder / "in", "a-0", 2)
    before = started(folder / "out")
    done, made = again(folder)
    assert surfaces_since(before, folder) == {"a"}
    assert done == walls_of("a")
    assert made.said is not None
    facades = r"4 of \d+ facades \(3: pictures of the building changed, 1: photo changed\)"
    assert re.match(rf"pending: {facades}, 1 of \d+ surfaces ", made.said)
    assert_as_fresh(folder, made)


def test_an_exemplar_changed(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    taken = {r["unit"]: r["source"] for r in read_newest_journal(folder / "out" / "store", "facades") if r}
    assert set(taken.values()) <= {"a-0.png", "0", "1"}
    for name in ("0", "1"):
        users = {unit for unit, source in taken.items() if source == name}
        in_own_style = {unit for unit, source in taken.items() if source == "a-0.png" and unit != "a-0"}
        path = folder / "in" / "exemplars" / f"{name}.png"
        with Image.open(path) as image:
            flipped = ImageOps.mirror(image)
        flipped.save(path)
        done, made = again(folder)
        assert {name} | users <= done - ALL_STREETS <= {name} | users | in_own_style
        assert not done & ALL_STREETS
        assert made.said is not None
        assert made.said.startswith("pending: 1 of 2 exemplars (picture changed)")


def test_a_photo_that_comes_or_is_refused_changes_its_own_building_alone(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    write_photo(folder / "in", "b-2", 2)
    before = started(folder / "out")
    done, made = again(folder)
    assert surfaces_since(before, folder) == {"b"}
    assert made.said is not None
    assert "1: new photo" in made.said
    assert done - ALL_STREETS == walls_of("b"), "its other walls take its colour"
    assert records_of(folder)["b-0"]["source"] == "b-2.png", "and its style"
    (folder / "in" / "photos" / "b-2.png").write_bytes(b"no picture")
    (folder / "in" / "photos" / "a-0.png").write_bytes((folder / "in" / "photos" / "a-0.png").read_bytes()[:2000])
    done, made = again(folder)
    assert done - ALL_STREETS == walls_of("a") | walls_of("b")
    records = records_of(folder)
    assert {r["status"] for r in records.values()} == {"done"}
    assert records["b-2"]["source"] == records["b-0"]["source"], "that of its building"
    assert records["b-2"]["reason"].startswith("b-2.png")
    assert records["b-2"]["reason"].endswith(f"; textured from exemplar {records['b-0']['source']}")
    assert "Traceback" in records["b-2"]["traceback"]
    assert "reason" not in records["b-0"]
    told = {(name, records[name]["reason"]) for name in ("a-0", "b-2")}
    assert set(made.refused) == told
    assert_as_fresh(folder, made)
    done, made = again(folder)
    assert done == set()
    assert set(made.refused) == told, "again, as long as it is so"


def test_another_seed_is_told_as_one(plain: Path, pictured: Path, tmp_path: Path) -> None:
    for number, (made_of, keys) in enumerate(((plain, PLAIN), (pictured, PICTURED))):
        folder = copied(made_of, tmp_path / str(number))
        write_block(folder / "in", **keys, seed=4)
        said = again(folder)[1].said or ""
        if made_of is plain:  # facades without a picture take no random choice
            assert said.startswith("pending: 32 of 32 surfaces (block's settings changed); ")
        else:
            assert ", 3 of 3 streets (block's settings changed), " in said


def test_the_density_reaches_everything(pictured: Path, tmp_path: Path) -> None:
    folder = copied(pictured, tmp_path)
    before = set(started(folder / "out"))
    write_block(folder / "in", **PICTURED | {"texture": PICTURED["texture"] | {"texels_per_metre": 4}})
    held = started(folder / "out")
    made = texture(folder / "in" / "block.yaml", folder / "out")
    assert redone(held, folder / "out") >= before
    assert made.said == "everything is pending: texture.texels_per_metre was 3 and is 4"


def test_units_done_by_other_code_are_due(pictured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = copied(pictured, tmp_path)
    monkeypatch.setattr("tasks.engine.stage.stage_code_digest", _other_code("facades"))
    done, made = again(folder)
    assert done == {unit for stage, unit in started(folder / "out") if stage == "facades"}
    assert made.said is not None
    assert "6 of 6 facades (code or a library changed)" in made.said


def test_other_code_that_ingests_takes_over_what_is_the_same(
    pictured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copied(pictured, tmp_path)
    for reader in ("tasks.engine.run_key.stage_code_digest", "tasks.stages.ingest.task.stage_code_digest"):
        monkeypatch.setattr(reader, _other_code("ingest"))
    done, made = again(folder)
    assert done == set()
    assert made.run.key != _key_of(pictured)
    assert made.said == NOTHING_PENDING


def test_a_store_from_before_a_stage_was_there_goes_on(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    digests = digests_of(folder / "out")
    session = open_repository(folder / "out" / "store").writable_session(BRANCH)
    group: Any = zarr.open_group(session.store)
    for stage in ("poses", "exemplars"):
        del group[f"journal/{stage}"]
    commit(session, "older")
    run = create_run(read_block(folder / "in" / "block.yaml"), folder / "out")
    assert completion_summary(run) is None
    done, _ = again(folder)
    assert done == {"0", "1"}, "the exemplars, of which nothing is known; what was made from them stands"
    assert digests_of(folder / "out") == digests


def test_other_code_that_publishes_does_nothing_else(
    pictured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copied(pictured, tmp_path)
    run = create_run(read_block(folder / "in" / "block.yaml"), folder / "out")
    first = publish_block.fn(run)
    done = completion_summary(run)
    assert done is not None
    assert done["units_done"] == 0
    for reader in ("tasks.publish.task.stage_code_digest", "tasks.engine.store.status.stage_code_digest"):
        monkeypatch.setattr(reader, _other_code("publish"))
    assert completion_summary(run) is None
    before = started(folder / "out")
    second = publish_block.fn(run)
    assert redone(before, folder / "out") == set()
    assert completion_summary(run) is not None
    assert first["atlas_digest"] == second["atlas_digest"]
    assert first["outputs"]["items"] != second["outputs"]["items"]  # readers of the first are not disturbed
    assert Path(first["outputs"]["items"]).is_file()


def _key_of(folder: Path) -> str:
    import zarr

    from facade_core.atlas.store import open_repository

    store = open_repository(folder / "out" / "store").readonly_session("main").store
    return str(zarr.open_group(store, mode="r").attrs["key"])


def _other_code(stage: str) -> Callable[..., str]:
    return lambda one, **options: "new" if one == stage else stage_code_digest(one, **options)


def _places(folder: Path) -> tuple[list[int], list[tuple[int, int, int]]]:
    """The ids of all charts, and where they lie."""
    import zarr

    from facade_core.atlas.store import open_repository
    from facade_core.plan.plan_tables import read_plan

    session = open_repository(folder / "out" / "store").readonly_session("main")
    assert read_journal(zarr.open_group(session.store, mode="r"), "streets")
    plan = read_plan(session)
    placement: Any = plan.scene.placement
    return plan.ids.tolist(), list(
        zip(placement.page.tolist(), placement.x.tolist(), placement.y.tolist(), strict=True)
    )


def test_corrected_elements_reach_the_surface_of_a_wall_whose_colours_stay(tmp_path: Path) -> None:
    """The material of the building is measured beside the labels of its windows."""
    write_photo(tmp_path / "in", "a-0", 1)
    block_file = write_block(tmp_path / "in", texture={"walls": "translate"})
    texture(block_file, tmp_path / "out")
    seed = records_of(tmp_path)["a-0"]["digests"]
    append_corrections_to_file(block_file, [Correction("a-0", "elements", [["window", 0.02, 0.02, 0.6, 0.6]])])
    before = started(tmp_path / "out")
    made = texture(block_file, tmp_path / "out")
    assert records_of(tmp_path)["a-0"]["digests"] == seed
    assert surfaces_since(before, tmp_path) == {"a"}
    assert_as_fresh(tmp_path, made)
