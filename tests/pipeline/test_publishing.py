"""What is published is put together of what units finished: a change makes its own page and tile again, a loss is set aside."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import lxml.html
import numpy as np
import pytest
import trimesh
from PIL import Image

from catalogs.block.reader import read_block
from catalogs.published.file_list import find_snapshot_damage
from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from catalogs.query.execution import query
from facade_core.atlas.journal import clear_record, read_journal
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.atlas.stored_files import (
    HIERARCHIES,
    page_picture_path,
    picture_path,
    read_stored_file,
    tile_paths,
)
from facade_core.core.zarr_types import get_subgroup
from facade_core.export.models.glb import read_glb_header, replace_copyright
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.fan_out import process_batch
from tasks.engine.pending import find_pending_units
from tasks.engine.run_key import create_run
from tasks.engine.store.integrity import is_store_marked_suspect, repair_store
from tasks.engine.store.status import completion_summary, explain_unpublished
from tasks.publish.stored_block import StoredBlock, read_stored_block
from tasks.publish.task import publish_block
from tasks.stages.pictures import stage as pictures
from tasks.stages.pictures.stage import PICTURES
from tests.pipeline.stages import Textured, redone, started, texture, write_block, write_photo

NAMES = {"a", "b", "c", "d", "e"}


@pytest.fixture(scope="module")
def seeded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The block with a photo of the facade beyond the crossing, published."""
    folder = tmp_path_factory.mktemp("published")
    write_photo(folder / "in", "c-0", 1)
    write_block(folder / "in")
    again(folder)
    return folder


def again(folder: Path) -> tuple[Textured, dict[str, Any], SnapshotFolder[Path]]:
    made = texture(folder / "in" / "block.yaml", folder / "out")
    summary = publish_block.fn(made.run, folder / "in" / "block.yaml")
    return made, summary, current_snapshot(folder / "out")


def copied(folder: Path, to: Path) -> Path:
    shutil.copytree(folder, to / "copy", copy_function=shutil.copy2)
    return to / "copy"


def listed(snapshot: SnapshotFolder[Path]) -> dict[str, dict[str, Any]]:
    return {tile["path"]: tile for tile in json.loads(snapshot.tiles.read_text())["tiles"]}


@pytest.mark.long
def test_tiles_are_the_block(seeded: Path) -> None:
    snapshot = current_snapshot(seeded / "out")
    tiles = listed(snapshot)
    assert sorted(name for tile in tiles.values() for name in tile["buildings"]) == sorted(NAMES)
    whole = trimesh.load(snapshot.model)
    origin = _origin(snapshot.model)
    triangles = 0
    for path, tile in tiles.items():
        data = snapshot.tile(path).read_bytes()
        assert (len(data), sha256(data).hexdigest()) == (tile["bytes"], tile["sha256"])
        model = trimesh.load(snapshot.tile(path))
        triangles += sum(len(part.faces) for part in model.geometry.values())
        assert {name for name in model.graph.nodes_geometry if name != "ground"} == set(tile["buildings"])
        low, high = np.array(tile["box"]) - tile["origin"]
        np.testing.assert_allclose(model.bounds, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=0.01)
    assert triangles == sum(len(part.faces) for part in whole.geometry.values())
    boxes = np.array([tile["box"] for tile in tiles.values()]) - origin
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    np.testing.assert_allclose(whole.bounds, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=0.01)
    overview = trimesh.load(snapshot.overview)
    np.testing.assert_allclose(overview.bounds, whole.bounds, atol=1.0, err_msg="balconies come out by less")
    item = json.loads((snapshot.stac / "blocks" / "small.json").read_text())
    for path, tile in tiles.items():
        asset = item["assets"][f"tile-{path}"]
        assert (snapshot.stac / "blocks" / asset["href"]).resolve() == snapshot.tile(path)
        assert (asset["file:size"], asset["file:checksum"]) == (tile["bytes"], f"1220{tile['sha256']}")
    assert {"overview", "tiles", "model"} <= item["assets"].keys()


@pytest.mark.long
def test_one_photo_makes_one_tile_and_its_page_and_the_rest_is_linked(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    before, first = started(folder / "out"), current_snapshot(folder / "out")
    write_photo(folder / "in", "c-0", 2)
    made, _, second = again(folder)
    finished = ("pages", "tiles", "pictures")
    done = {(stage, unit) for stage, unit in redone(before, folder / "out") if stage in finished}
    group = read_stored_block(open_repository(made.run.store).readonly_session(BRANCH))
    chart = group.plan.facades.chart[group.plan.facades.id.index("c-0")]
    [tile] = [path for path, one in listed(second).items() if "c" in one["buildings"]]
    # the views along other streets do not look that way
    views = {("pictures", f"view {name}") for name in ("above", "street-2", "close-up")}
    page = f"{group.plan.scene.placement.page[chart]:04}"
    assert done == {("pages", page), ("tiles", tile), ("pictures", "c-0"), *views}
    linked = {
        path.relative_to(second.folder).as_posix()
        for path in second.folder.rglob("*")
        if path.is_file() and path.stat().st_nlink > 1
    }
    assert {f"tiles/{path}.glb" for path in listed(second)} - linked == {f"tiles/{tile}.glb"}
    sheets = {path.name for path in (second.report / "images").glob("*.webp")}
    assert {name for name in sheets if f"report/images/{name}" not in linked} == {
        name for name in sheets if name.startswith("c-0-")
    }
    assert find_snapshot_damage(second.folder, thorough=True) is None
    fresh = tmp_path / "fresh"
    shutil.copytree(folder / "in", fresh / "in")
    third = again(fresh)[2]
    for pattern in ("pages/*", "tiles/*", "*.glb", "report/images/*"):
        ours, theirs = ({p.name: p.read_bytes() for p in s.folder.glob(pattern)} for s in (second, third))
        assert ours == theirs
    assert first.folder.is_dir()


@pytest.mark.long
def test_a_tile_that_is_lost_is_named_and_the_rest_is_published(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    shutil.rmtree(folder / "out" / "published")
    whole = current_snapshot(seeded / "out")
    with whole.tile("375_6514").open("rb") as tile:
        named = read_glb_header(tile)[0]["asset"]["copyright"]

    def as_published(data: bytes) -> bytes:
        return replace_copyright(data, named) if data.startswith(b"glTF") else data

    for lost in (whole.tile("375_6514"), whole.page(0)):
        chunks = (folder / "out" / "store" / "chunks").iterdir()
        [chunk] = [path for path in chunks if as_published(path.read_bytes()) == lost.read_bytes()]
        chunk.write_bytes(b"\0" * chunk.stat().st_size)  # as a disk may, with nothing amiss in sizes
    made, summary, snapshot = again(folder)
    told = {one["unit"]: one["reason"] for one in summary["unpublished"]}
    assert told.keys() == {"page 0000", "tile 375_6514"}
    assert all("not as it was written" in reason for reason in told.values())
    assert listed(snapshot).keys() == listed(whole).keys() - {"375_6514"}
    assert snapshot.items.is_file()
    assert len(query(folder / "out")) == len(query(seeded / "out"))
    assert (snapshot.stac / "blocks" / "small.json").is_file()
    assert "a" not in trimesh.load(snapshot.model).graph.nodes_geometry
    assert (snapshot.report / "index.html").is_file()
    assert explain_unpublished(folder / "out", snapshot.id) is not None
    assert completion_summary(made.run) is None
    assert is_store_marked_suspect(folder / "out")
    assert repair_store(made.run)
    made, summary, snapshot = again(folder)
    assert "unpublished" not in summary
    assert listed(snapshot) == listed(whole)
    for name in ("block.glb", "overview.glb", "pages/0000.jpg"):
        assert (snapshot.folder / name).read_bytes() == (whole.folder / name).read_bytes(), name


def test_coarse_rasters_that_are_not_as_written_are_made_again(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    shutil.rmtree(folder / "out" / "published")
    session = open_repository(folder / "out" / "store").writable_session(BRANCH)
    group = open_root(session)
    group[path := tile_paths("375_6514")[1]][:] = 7
    session.commit("garbled")
    made, summary, _ = again(folder)
    assert path in {one["unit"] for one in summary["unpublished"]}
    assert is_store_marked_suspect(folder / "out")
    assert repair_store(made.run)
    _, summary, snapshot = again(folder)
    assert "unpublished" not in summary
    assert snapshot.overview.read_bytes() == current_snapshot(seeded / "out").overview.read_bytes()


@pytest.mark.long
def test_a_picture_that_is_lost_or_damaged_is_made_again_and_no_other(seeded: Path, tmp_path: Path) -> None:
    folder = copied(seeded, tmp_path)
    shutil.rmtree(folder / "out" / "published")
    session = open_repository(folder / "out" / "store").writable_session(BRANCH)
    group = open_root(session)
    files = {record["unit"]: picture_path(record["file"]) for record in read_journal(group, "pictures") if record}
    del group[files["a-0"]]
    group[files["c-0"]][:] = 7
    group[files["view above"]][:] = 7
    session.commit("garbled")
    before = started(folder / "out")
    made, summary, snapshot = again(folder)
    told = {one["unit"]: one["reason"] for one in summary["unpublished"]}
    assert told.keys() == {"view above", "pictures of facade a-0", "pictures of facade c-0"}
    assert all(reason.endswith("the next run makes it again") for reason in told.values())
    assert not (snapshot.report / "images" / "above.jpg").exists()
    assert is_store_marked_suspect(folder / "out")
    assert "3 pictures (" in repair_store(made.run)[0]
    _, summary, snapshot = again(folder)
    assert "unpublished" not in summary
    assert redone(before, folder / "out") == {("pictures", unit) for unit in ("view above", "a-0", "c-0")}
    ours, theirs = (_images(one) for one in (snapshot, current_snapshot(seeded / "out")))
    assert ours == theirs


@pytest.mark.long
def test_a_picture_that_cannot_be_drawn_leaves_the_others(
    seeded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as a view of which a page is not as it was written: its unit fails in one line, and nothing is withheld for it."""
    folder = copied(seeded, tmp_path)
    made, _, _ = again(folder)
    session = open_repository(made.run.store).writable_session(BRANCH)
    group = open_root(session)
    for unit in range(4):
        clear_record(group, "pictures", unit)
    group[page_picture_path(0)][:] = 7
    session.commit("garbled")
    block = read_block(folder / "in" / "block.yaml")
    outcome = process_batch.fn(
        made.run,
        "pictures",
        "1",
        PICTURES.function,
        find_pending_units(made.run, block, PICTURES).pieces,
        SerialCompute(),
    )
    failed = dict(outcome.failed)
    assert failed["view above"] == "pages/0 is not as it was written; the next run makes it again"
    summary = publish_block.fn(made.run, folder / "in" / "block.yaml")
    assert "withheld" not in summary
    snapshot = current_snapshot(folder / "out")
    rows = query(folder / "out", where="kind = 'picture'")
    assert set(rows["id"]) == set(failed)
    assert len(list((snapshot.report / "images").glob("c-0-*.webp"))) > 3
    assert not (snapshot.report / "images" / "above.jpg").exists()
    assert is_store_marked_suspect(folder / "out")
    assert repair_store(made.run)
    snapshot = again(folder)[2]
    ours, theirs = (_images(one) for one in (snapshot, current_snapshot(seeded / "out")))
    assert ours == theirs


def test_publishing_copies_pictures_and_draws_none(
    seeded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever lies where they were drawn from, files are those of the store, by the names and in the order of the stages."""
    folder = copied(seeded, tmp_path)
    shutil.rmtree(folder / "out" / "published")
    session = open_repository(folder / "out" / "store").writable_session(BRANCH)
    group = open_root(session)
    for path in ("atlas/seed", "atlas/colour", "facade_maps/labels", "facade_maps/evidence"):
        group[path][:] = 0
    for path, _ in list(get_subgroup(group, HIERARCHIES).arrays()):
        del group[f"{HIERARCHIES}/{path}"]
    session.commit("nothing to draw from")
    made = create_run(read_block(folder / "in" / "block.yaml"), folder / "out")
    publish_block.fn(made, folder / "in" / "block.yaml")
    images = _images(current_snapshot(folder / "out"))
    for record in read_journal(group, "pictures"):
        assert record is not None
        data = read_stored_file(group, picture_path(record["file"]), record["digest"])
        for name, _, offset, length in record.get("pictures", ()):
            assert images.pop(f"{record['unit']}-{name}.webp") == data[offset : offset + length]
        if "pictures" not in record:
            assert images.pop(f"{record['file']}.jpg") == data
    assert all(name.startswith(("panorama-", "exemplar-")) for name in images)


def test_models_that_other_code_puts_together_are_not_linked(
    seeded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copied(seeded, tmp_path)
    for reader in ("tasks.publish.task.stage_code_digest", "tasks.publish.tiles.stage_code_digest"):
        monkeypatch.setattr(reader, lambda stage: f"other {stage}")
    first = current_snapshot(folder / "out")
    _, _, second = again(folder)
    assert first != second
    for model in (second.model, second.overview):
        assert model.stat().st_nlink == 1
    assert all(second.tile(path).stat().st_nlink > 1 for path in listed(second))


def test_a_step_that_fails_leaves_the_others(
    seeded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = copied(seeded, tmp_path)
    shutil.rmtree(folder / "out" / "published")

    def no_model(*_: Any) -> None:
        raise ValueError("nothing is as large")

    with monkeypatch.context() as patch:
        patch.setattr("tasks.publish.task.write_block_model", no_model)
        _, summary, snapshot = again(folder)
    assert {one["unit"] for one in summary["unpublished"]} == {"block.glb"}
    said = "block.glb is not published: stopped by an error of its own (ValueError: nothing is as large); "
    assert any(message.startswith(said) for message in caplog.messages)
    assert not snapshot.model.is_file()
    assert len(list((snapshot.report / "images").glob("c-0-*.webp"))) > 3
    _, summary, repaired = again(folder)
    assert "unpublished" not in summary
    assert repaired == snapshot
    assert repaired.model.is_file()
    assert find_snapshot_damage(repaired.folder, thorough=True) is None


def test_the_report_is_an_index_with_pages_for_each_street(
    seeded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copied(seeded, tmp_path)
    shutil.rmtree(folder / "out" / "published")
    monkeypatch.setattr(pictures, "MAX_STAGED_PER_STREET", 1)
    monkeypatch.setattr("catalogs.published.report.MAX_FACADES_PER_PAGE", 1)

    def with_a_part(*given: Any) -> StoredBlock:
        block = read_stored_block(*given)
        return replace(block, buildings={**block.buildings, "part_of": ["b", *block.buildings["part_of"][1:]]})

    monkeypatch.setattr("tasks.publish.task.read_stored_block", with_a_part)
    report = again(folder)[2].report
    pages = sorted(report.rglob("*.html"))
    facades = query(folder / "out", where="role = 'street'")
    shown: dict[str, Path] = {}
    drawn: list[Path] = []
    for path in pages:
        page = lxml.html.document_fromstring(path.read_text("utf-8"))
        for element in page.iter("a", "img"):
            target = path.parent / unquote(urlparse(element.get("href") or element.get("src")).path)
            assert target.is_file(), target
            if element.tag == "img":
                drawn.append(target.resolve())
                with Image.open(target) as image:
                    image.verify()
        details = {one.get("id"): path for one in page.iter("details")}
        if path.name == "exemplars.html":
            assert {row["source"] for _, row in facades.iterrows() if row["synthesised"] > 0} <= set(details)
        else:
            shown |= details
    assert set(shown) == set(facades["id"])
    assert len(set(shown.values())) == len(facades), "one to a page"
    assert sorted(drawn) == sorted((report / "images").iterdir()), "each is shown once"
    index = lxml.html.document_fromstring((report / "index.html").read_text("utf-8"))
    assert "5 buildings, height from height" in index.text_content(), "with the parts of buildings"
    to_look_at = {urlparse(one.get("href")).fragment for one in index.iter("a")} - {""}
    assert to_look_at == set(facades["id"][~facades["quality"].isin(["good", "height-assumed"])]), "those to look at"
    for street, own in facades.groupby("street"):
        page = shown[own["id"].iloc[-1]].read_text()
        others = [id for id, photo in zip(own["id"], own["photo"], strict=True) if not photo > 0]
        assert ("streetloom view" in page) == (own["id"].iloc[-1] in others[1:]), street
    assert len(list((report / "images").glob("c-0-*"))) > 3, "it is from a photo"


def _images(snapshot: SnapshotFolder[Path]) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (snapshot.report / "images").iterdir()}


def _origin(path: Path) -> np.ndarray:
    data = path.read_bytes()
    return np.array(json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["scenes"][0]["extras"]["origin"])
