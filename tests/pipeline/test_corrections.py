"""What people corrected: taken back from exports, done again alone, kept whatever else changes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest

from catalogs.block.corrections import corrections_file, read_corrections
from catalogs.block.reader import read_block
from catalogs.query.execution import query
from facade_core.core.errors import InputError
from facade_core.facade.layout.model import SHIPPED_LAYOUT_MODEL
from tasks.corrections.correction_import import CorrectionImporter, import_corrections
from tasks.engine.run_key import create_run
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.status import read_run_block_file, record_run_block_file
from tasks.export.formats import export_run
from tasks.stages.facades.exemplar_choices import delete_exemplar_choices
from tasks.viewing.facade_state import read_facade_state
from tasks.viewing.run_view import RunReader
from tests.pipeline.corrected import HOUSES, STREET, made, textured_houses
from tests.pipeline.stages import digests_of, redone, started, texture, write_block
from training.datasets.corrected_facades import load_corrected_facades

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return textured_houses(tmp_path_factory.mktemp("corrected"))


@pytest.fixture
def folder(once: Path, tmp_path: Path) -> Path:
    shutil.copytree(once, tmp_path / "block")
    record_run_block_file(tmp_path / "block" / "out", tmp_path / "block" / "in" / "block.yaml")
    return tmp_path / "block"


def record(folder: Path, facade: str) -> dict[str, Any]:
    return next(dict(r) for r in read_newest_journal(folder / "out" / "store", "facades") if r and r["unit"] == facade)


def facades_since(before: dict[tuple[str, str], float], folder: Path) -> set[str]:
    return {unit for stage, unit in redone(before, folder / "out") if stage == "facades"}


def own(folder: Path, *corrections: dict[str, Any]) -> Path:
    path = folder / "said.json"
    path.write_text(json.dumps({"corrections": corrections}))
    return path


# What is given back of an export, by its format.
GIVEN = {
    "coco": "annotations.json", "labelme": ".", "gpkg": "small.gpkg", "cityjson": "small.city.json",
    "lod3": "small.lod3.city.json", "cityjsonseq": "small.city.jsonl",
}  # fmt: skip


def given(folder: Path, format: str, to: str) -> Path:
    return export_run(folder / "out", format, folder / to).path / GIVEN[format]


def test_what_was_corrected_is_done_again_exported_and_taken_back_as_it_stands(folder: Path) -> None:
    """For every format: an export that nobody changed corrects nothing, before any correction and after one of every kind."""
    out, block = folder / "out", folder / "in" / "block.yaml"
    for format in GIVEN:
        done = import_corrections(out, given(folder, format, f"before-{format}"), who="anna")
        assert (done.facades, done.buildings, done.notes) == (0, 0, ()), format
    assert not corrections_file(block).exists()
    plain = record(folder, "b-2")
    said = own(
        folder,
        {"facade_id": "b-2", "elements": [["window", 0.2, 0.2, 0.5, 0.5], ["door", 0.6, 0.7, 0.7, 1.0]]},
        {"facade_id": "a-0", "facade": False, "hide": [[0.0, 0.6, 0.4, 1.0]], "keep": [[0.5, 0.0, 0.6, 0.2]]},
        {"building_id": "a", "height": 8.333, "levels": 2, "roof_shape": "gabled", "roof_height": 2.5},
        {"building_id": "a", "wall_material": "Brick", "roof_material": "slate", "roof_colour": "red"},
        {"building_id": "b", "exemplar": "1" if plain["source"] == "0" else "0", "wall_colour": "#e0c080", "levels": 3},
        {"building_id": "b", "roof_shape": "hipped"},
    )
    import_corrections(out, said, who="anna")
    made(folder)
    for format in GIVEN:
        done = import_corrections(out, given(folder, format, f"after-{format}"), who="ben")
        assert (done.facades, done.buildings, done.notes) == (0, 0, ()), format
    assert import_corrections(out, said, who="ben").lines() == [
        "nothing differs from what was published; nothing was written"
    ]
    attributes = json.loads((folder / "after-cityjson" / GIVEN["cityjson"]).read_text())["CityObjects"]["a"]
    told = {
        "storeysAboveGround": 2, "roofType": "gabled", "eavesHeight": 8.33, "roofHeight": 2.5, "wallMaterial": "brick",
        "wallColour": "#965442", "roofMaterial": "slate", "roofColour": "#9e4232",
    }  # fmt: skip
    assert told.items() <= attributes["attributes"].items()
    table = geopandas.read_file(folder / "after-gpkg" / GIVEN["gpkg"], layer="buildings").set_index("id")
    assert table.loc["b", ["wall_colour", "roof_shape"]].tolist() == ["#e0c080", "hipped"]
    assert table.loc["b", "roof_height_m"] > 0.5


def test_attributes_of_cityjson_are_taken_back_and_nothing_else_is_done_again(folder: Path) -> None:
    out = folder / "out"
    file = given(folder, "cityjson", "exported")
    document = json.loads(file.read_text())
    house = document["CityObjects"]["b"]
    house["attributes"] |= {"eavesHeight": 8.5, "storeysAboveGround": 2, "roofType": "gabled", "wallMaterial": "brick"}
    (wall,) = [s for s in house["geometry"][0]["semantics"]["surfaces"] if s.get("facade") == "b-2"]
    assert wall["isFacade"] is True
    wall["isFacade"] = False
    document["CityObjects"]["a"]["attributes"]["measuredHeight"] += 1.25
    file.write_text(json.dumps(document))
    before = started(out)
    done = import_corrections(out, file, who="anna", why="as built")
    assert (done.facades, done.buildings) == (1, 2)
    (note,) = done.notes
    assert note.startswith("b: 3 walls are textured from exemplars or pictures"), "its brick waits for them"
    assert not import_corrections(out, file, who="anna").files
    said = read_corrections(folder / "in" / "block.yaml")
    assert said.value_correction("a", "height") == 8.25, "its eaves by as much"
    assert said.value_correction("b", "height") == 8.5
    assert said.value_correction("b-2", "facade") is False
    made(folder)
    assert facades_since(before, folder) == {f"{house}-{wall}" for house in "ab" for wall in range(4)}
    assert not import_corrections(out, file, who="anna").files, "nor once it stands"
    row = query(out, where="corrected = 1 and id = 'b-2'").iloc[0]
    assert (row["height_m"], row["roof_shape"], row["levels"]) == (8.5, "gabled", 2)
    anew = json.loads(given(folder, "cityjson", "anew").read_text())["CityObjects"]["b"]
    assert [s["isFacade"] for s in anew["geometry"][0]["semantics"]["surfaces"] if s.get("facade") == "b-2"] == [False]


def test_a_house_that_is_corrected_is_found_again_by_its_place(folder: Path) -> None:
    out = folder / "out"
    import_corrections(out, own(folder, {"building_id": "b", "height": 12.0, "wall_material": "brick"}), who="anna")
    write_block(folder / "in", buildings={"a": HOUSES["a"], "x": HOUSES["b"]}, streets=STREET)
    made(folder)
    assert query(out, where="corrected = 1 and id = 'x-2'")["height_m"].tolist() == [12.0]
    assert import_corrections(out, given(folder, "gpkg", "exported"), who="anna").buildings == 0
    import_corrections(out, own(folder, {"building_id": "x", "height": 10.0}), who="anna")
    made(folder)
    assert query(out, where="id = 'x-2'")["height_m"].tolist() == [10.0], "its own is newer"
    # who edits it sees that, and takes it back whatever it was called
    view = RunReader(out).open_newest()
    stands = read_facade_state(view, view.find_facade_index("x-2"), read_corrections(folder / "in" / "block.yaml"))
    assert (
        stands["said"]["height"],
        stands["said"]["wall_material"],
        {one["what"] for one in stands["corrected"]},
    ) == (10.0, "brick", {"height", "wall_material"})
    done = CorrectionImporter(out).add(
        [{"building_id": "x", "height": None, "wall_material": None}], "said", who="anna"
    )
    assert done.buildings == 2, "under both ids"
    assert not read_corrections(folder / "in" / "block.yaml")


def test_a_copy_of_a_run_with_its_block_is_corrected_by_itself(tmp_path: Path) -> None:
    block = write_block(tmp_path / "out" / "input", buildings=HOUSES, streets=STREET)
    record_run_block_file(tmp_path / "out", block)
    shutil.copytree(tmp_path / "out", tmp_path / "copy")
    assert read_run_block_file(tmp_path / "out") == block
    assert read_run_block_file(tmp_path / "copy") == tmp_path / "copy" / "input" / "block.yaml"
    record_run_block_file(tmp_path / "copy", block)
    assert read_run_block_file(tmp_path / "copy") == block, "of a block elsewhere"


def test_corrected_boxes_are_done_again_alone_and_come_back_as_they_are(folder: Path, tmp_path: Path) -> None:
    written = export_run(folder / "out", "coco", folder / "exported").path / "annotations.json"
    document = json.loads(written.read_text())
    image = next(one for one in document["images"] if one["facade"] == "b-2")
    ours = [one for one in document["annotations"] if one["image_id"] == image["id"]]
    assert len(ours) > 1
    gone, moved = ours[0], ours[1]
    document["annotations"].remove(gone)
    moved["bbox"] = [moved["bbox"][0], 1.0, 3.0, 4.0]
    written.write_text(json.dumps(document))
    taker = CorrectionImporter(folder / "out")
    assert not taker.add([{"facade_id": "b-2", "hide": [], "keep": None, "facade": True}], "said", who="anna").files
    done = import_corrections(folder / "out", written, who="anna", why="seen from the street")
    assert (done.facades, done.buildings) == (1, 0)
    kept = read_corrections(folder / "in" / "block.yaml").by_target["b-2"]["elements"]
    assert (kept.who, kept.why) == ("anna", "seen from the street")
    before = started(folder / "out")
    again = made(folder)
    assert again.said is not None
    assert "1 of" in again.said
    assert "(corrected)" in again.said
    assert facades_since(before, folder) == {"b-2"}
    found = record(folder, "b-2")
    names = {one["id"]: one["name"] for one in document["categories"]}
    given = [names[one["category_id"]] for one in ours[1:]]
    assert sorted(element[0] for element in found["elements"]) == sorted(given)
    assert any(
        np.allclose(e[1:5], [moved["bbox"][0], 1, moved["bbox"][0] + 3, 5], atol=0.06) for e in found["elements"]
    )
    assert set(query(folder / "out", where="corrected = 1")["id"]) == {"b-2"}
    assert import_corrections(folder / "out", written, who="anna").facades == 0, "it stands as it was said"
    newly = export_run(folder / "out", "coco", folder / "anew").path / "annotations.json"
    assert import_corrections(folder / "out", newly, who="anna").facades == 0, "and is exported so"
    assert texture(folder / "in" / "block.yaml", tmp_path / "fresh").said is None
    assert digests_of(tmp_path / "fresh") == digests_of(folder / "out")
    assert taker.add([{"facade_id": "b-2", "elements": None}], "said", who="anna").facades == 1, "what is published now"
    made(folder)
    assert len(record(folder, "b-2")["elements"]) == len(ours)


def test_corrected_facades_are_learnt_from_by_the_store(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = [["window", 0.25, 0.25, 0.5, 0.5]]
    import_corrections(folder / "out", own(folder, {"facade_id": "a-0", "elements": said}), who="anna")
    import_corrections(folder / "out", own(folder, {"facade_id": "b-2", "keep": [[0.0, 0.0, 0.5, 0.5]]}), who="anna")
    with pytest.raises(InputError, match="only 1 facade with corrected elements"):
        load_corrected_facades([folder / "out"])
    monkeypatch.setattr("training.datasets.corrected_facades.MIN_FACADES", 1)
    (one,) = load_corrected_facades([folder / "out"])
    assert (one.name, [list(e) for e in one.elements]) == ("small/a-0", said)
    assert one.image.shape == (*one.photo_mask.shape, 3)
    assert one.photo_mask.mean() > 0.9, "of a photo"


def test_a_models_file_of_the_block_is_what_facades_of_pictures_are_done_by(folder: Path) -> None:
    before = started(folder / "out")
    shutil.copy(SHIPPED_LAYOUT_MODEL, folder / "in" / "mine.json")
    keys = {"buildings": HOUSES, "streets": STREET, "models": {"layout": "mine.json"}}
    write_block(folder / "in", **keys)
    again = made(folder)
    assert again.said is not None
    assert "block's models changed" in again.said
    assert facades_since(before, folder) >= {"a-0"}
    (folder / "in" / "mine.json").write_text("{}")
    with pytest.raises(InputError, match=r"models\.layout: .*mine\.json: not a layout model"):
        made(folder)


def test_walls_that_are_none_exemplars_heights_and_what_is_in_front(folder: Path) -> None:
    before, plain = started(folder / "out"), record(folder, "a-0")
    source = record(folder, "b-2")["source"]
    other = "1" if source == "0" else "0"
    done = import_corrections(
        folder / "out",
        own(
            folder,
            {"facade_id": "a-0", "hide": [[0.0, 0.6, 0.4, 1.0]]},
            {"building_id": "b", "exemplar": other},
        ),
        who="anna",
    )
    assert (done.facades, done.buildings) == (1, 1)
    made(folder)
    assert record(folder, "b-2")["source"] == other
    assert record(folder, "a-0")["occluded"] > plain["occluded"] + 0.1
    assert {"a-0", "b-2"} <= facades_since(before, folder)
    assert set(query(folder / "out", where="corrected = 1 and role = 'street'")["id"]) >= {"a-0", "b-2"}
    import_corrections(folder / "out", own(folder, {"facade_id": "a-0", "facade": False}), who="anna")
    import_corrections(folder / "out", own(folder, {"building_id": "b", "height": 12.0}), who="anna")
    made(folder)
    assert record(folder, "a-0")["source"] == "translator"
    texture(folder / "in" / "block.yaml", folder / "fresh")
    delete_exemplar_choices(create_run(read_block(folder / "in" / "block.yaml"), folder / "out"))
    made(folder)
    assert digests_of(folder / "fresh") == digests_of(folder / "out"), "nothing is left of the photo that it had"
    assert query(folder / "out", where="id = 'b-2'")["height_m"].tolist() == [12.0]


def test_tables_of_buildings_and_of_facades_correct_heights_and_what_is_none(folder: Path) -> None:
    file = next(export_run(folder / "out", "gpkg", folder / "exported").path.glob("*.gpkg"))
    table = geopandas.read_file(file, layer="buildings")
    table.loc[table["id"] == "a", "height_m"] = 8.5
    table.to_file(file, layer="buildings")
    walls = geopandas.read_file(file, layer="facades")
    assert walls["is_facade"].all()
    walls.assign(is_facade=walls["id"] != "b-2").to_file(file, layer="facades")
    done = import_corrections(folder / "out", file, who="anna")
    assert (done.facades, done.buildings) == (1, 1)
    assert read_corrections(folder / "in" / "block.yaml").value_correction("b-2", "facade") is False
    assert {building.id: building.height for building in read_block(folder / "in" / "block.yaml").buildings} == {
        "a": 8.5,
        "b": 9.0,
    }


def test_what_walls_are_of_is_told_where_they_have_textures_and_is_counted_where_something_changes(
    folder: Path,
) -> None:
    out, walls = folder / "out", {f"b-{wall}" for wall in range(4)}
    assert {record(folder, wall)["source"] for wall in walls} <= {"0", "1"}, "of exemplars"
    done = import_corrections(out, own(folder, {"building_id": "b", "wall_material": "brick"}), who="anna")
    assert done.buildings == 0
    assert done.notes == (
        "b: 4 walls are textured from exemplars or pictures, which no wall_material or wall_colour changes; give the building "
        "another exemplar",
    )
    assert read_corrections(folder / "in" / "block.yaml").value_correction("b", "wall_material") == "brick", (
        "kept for what they may be"
    )
    none = [{"facade_id": wall, "facade": False} for wall in sorted(walls)]
    done = import_corrections(out, own(folder, *none, {"building_id": "b", "wall_colour": "#7a3b2e"}), who="anna")
    assert (done.facades, done.buildings, done.notes) == (4, 1, ())
    done = import_corrections(out, own(folder, {"building_id": "a", "wall_material": "brick", "levels": 3}), who="anna")
    assert (done.buildings, len(done.notes)) == (1, 1)


def test_corrections_follow_a_wall_to_another_id_and_wait_where_it_is_gone(folder: Path) -> None:
    elements = [["window", 0.2, 0.2, 0.5, 0.5]]
    import_corrections(folder / "out", own(folder, {"facade_id": "b-2", "elements": elements}), who="anna")
    renamed = {"a": HOUSES["a"], "x": HOUSES["b"]}
    block = write_block(folder / "in", buildings=renamed, streets=STREET)
    done = made(folder)
    assert [element[0] for element in record(folder, "x-2")["elements"]] == ["window"]
    write_block(folder / "in", buildings={"a": HOUSES["a"]}, streets=STREET)
    made(folder)
    from facade_core.atlas.store import BRANCH, open_repository, open_root

    notes = open_root(open_repository(done.run.store).readonly_session(BRANCH)).attrs["notes"]
    assert any("not in the block as it is, kept and not used: 1 (b-2)" in str(note) for note in notes)
    assert "b-2" in read_corrections(block).by_target


def test_two_people_and_what_cannot_be(folder: Path) -> None:
    out = folder / "out"
    import_corrections(out, own(folder, {"facade_id": "a-0", "hide": [[0, 0, 0.1, 0.1]]}), who="anna")
    done = import_corrections(out, own(folder, {"facade_id": "a-0", "hide": [[0, 0, 0.2, 0.1]]}), who="ben")
    assert "anna corrected it on" in done.notes[0]
    lines = corrections_file(folder / "in" / "block.yaml").read_text().splitlines()
    assert len(lines) == 2
    for said, why in (
        ({"facade_id": "q-9", "facade": False}, "has no facade q-9"),
        ({"facade_id": "a-0", "elements": [["spire", 0, 0, 1, 1]]}, "'spire' is no element"),
        ({"facade_id": "a-0", "hide": [[0.5, 0, 0.5, 1]]}, "is no box"),
        ({"facade_id": "a-0", "colour": "red"}, "nothing that can be corrected"),
        ({"building_id": "a", "height": 1e9}, "is not within"),
        ({"building_id": "a", "exemplar": "villa"}, "there is no exemplar villa"),
        ({"building_id": "a", "wall_material": "brik"}, "wall_material brik; did you mean brick"),
        ({"building_id": "a", "roof_shape": "dome"}, "nothing is drawn of roof_shape dome"),
        ({"building_id": "a", "roof_colour": "bluish"}, "'bluish' is no colour"),
        ({"building_id": "a", "roof_height": 3.0}, "its roof is flat"),
        ({"building_id": "a", "levels": 3.5}, "storeys are whole, not 3.5; give 3 or 4"),
        ({"building_id": "a", "levels": 10**400}, "is no number"),
        ({"building_id": "a", "wall_material": "\ud800"}, "nothing is drawn of wall_material"),
        ({"facade_id": "a-0", "elements": "window"}, "'window' is no list of boxes"),
        ({"facade_id": "a-0", "hide": [[0, 0, float("inf"), 1]]}, "is no box"),
        ({"facade_id": "a-0", "facade": True}, "facade of a-0 is said twice"),
        ({"facade_id": "a-0", "building_id": "a", "levels": 2}, "names its facade_id or building_id"),
        ({"elements": []}, "names its facade_id or building_id"),
    ):
        good = {"facade_id": "a-0", "facade": False}
        with pytest.raises(InputError, match=why):
            import_corrections(out, own(folder, good, said), who="anna")
    (folder / "said.json").write_text('{"what": 1}')
    with pytest.raises(InputError, match="neither COCO nor LabelMe nor CityJSON"):
        import_corrections(out, folder / "said.json", who="anna")
    with pytest.raises(InputError, match="names and reasons anew"):
        import_corrections(out, own(folder, {"facade_id": "a-0", "facade": False}), who="anna", why="\udcff")
    assert corrections_file(folder / "in" / "block.yaml").read_text().splitlines() == lines, "all or none"
    import_corrections(out, own(folder, {"building_id": "a", "roof_shape": "gabled", "roof_height": 3}), who="anna")
    with pytest.raises(InputError, match="what its roof is without the corrected shape"):
        import_corrections(out, own(folder, {"building_id": "a", "roof_shape": None, "roof_height": 2}), who="anna")
    done = import_corrections(out, own(folder, {"building_id": "a", "roof_shape": None}), who="anna")
    assert "the roof_height 3 that was given with its shape stays" in done.notes[0]
    assert any("of roofs that are flat" in note for note in read_block(folder / "in" / "block.yaml").notes)
    corrections_file(folder / "in" / "block.yaml").write_text("{broken\n")
    with pytest.raises(InputError, match="line 1 is no correction"):
        read_block(folder / "in" / "block.yaml")
