"""What the catalogue says of facades, streets, runs, models and sources."""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import shapely
from shapely import LineString

import flows.viewer
from catalogs.block.reader import TextureSettings
from catalogs.block.sources import OPENSTREETMAP, block_data_sources
from catalogs.published.columns import ItemRow, build_item_row
from catalogs.published.facade_values import QUALITY_CHECKS, FacadeSource
from facade_core.core.types import SHIPPED_MODELS, Street, TrainedModelFiles
from tasks.examples.demo import write_demo
from tasks.publish.catalogue_facts import (
    FACADE_MODELS,
    CataloguedModel,
    _block_outline,
    models_used,
    run_facts,
    street_facts,
)

START = 1_800_000_000.0


@pytest.mark.parametrize("model", FACADE_MODELS, ids=lambda model: model.path.stem)
def test_what_models_learned_from_is_what_their_cards_say(model: CataloguedModel) -> None:
    if not model.card.is_file():
        assert model.trained_on == {}, "nothing is stated that no card says"
        return
    card = model.card.read_text(encoding="utf-8")
    for name, licence in model.trained_on.items():
        line = next(line for line in card.splitlines() if name in line)
        assert licence.partition(" (")[0] in line or f"{name} ({licence})" in card, name


def test_models_are_those_that_facades_were_made_with() -> None:
    run = cast(Any, SimpleNamespace(texture=TextureSettings(), models=SHIPPED_MODELS))
    assert models_used(run, [None, {"status": "failed"}]) == []
    network, layouts, layout_network = models_used(run, [{"lattice": {}}])
    assert layout_network.file == "facade_core/facade/layout/models/layout_network.onnx"
    assert network.sha256 == hashlib.sha256(FACADE_MODELS[0].path.read_bytes()).hexdigest()
    assert (network.file, layouts.id) == ("facade_core/parsing/models/network.onnx", "layouts")
    assert layouts.card is not None


def test_a_block_tells_of_its_own_models(tmp_path: Path) -> None:
    for suffix, text in ((".onnx", "weights"), (".json", '{"trained_on": {"our photos": "ours"}}')):
        (tmp_path / f"mine{suffix}").write_text(text)
    run = cast(Any, SimpleNamespace(texture=TextureSettings(), models=TrainedModelFiles(parser=tmp_path / "mine.onnx")))
    network, layouts, _ = models_used(run, [{"lattice": {}}])
    assert (network.file, network.title, network.card) == ("mine.onnx", "facade parser of the block", None)
    assert network.trained_on == {"our photos": "ours"}
    assert network.sha256 == hashlib.sha256(b"weights").hexdigest()
    assert layouts.file == "facade_core/facade/layout/models/layouts.json"
    (tmp_path / "layouts.json").write_text("{}")
    own = SimpleNamespace(texture=TextureSettings(), models=TrainedModelFiles(layout=tmp_path / "layouts.json"))
    assert [model.file for model in models_used(cast(Any, own), [{"lattice": {}}])][1:] == ["layouts.json"]
    for suffix, text in ((".onnx", "weights"), (".json", "{}")):
        (tmp_path / f"layout_network{suffix}").write_text(text)
    found = models_used(cast(Any, own), [{"lattice": {}}])
    assert [model.file for model in found][1:] == ["layouts.json", "layout_network.onnx"]
    assert own.models.files == tuple(
        tmp_path / f"layout{name}" for name in ("_network.onnx", "_network.json", "s.json")
    )


def test_the_catalogue_lists_networks_that_a_block_gives(tmp_path: Path) -> None:
    for name in ("segformer", "lama"):
        (tmp_path / f"{name}.onnx").write_text(name)
    models = TrainedModelFiles(segmentation=tmp_path / "segformer.onnx", inpainting=tmp_path / "lama.onnx")
    run = cast(Any, SimpleNamespace(texture=TextureSettings(), models=models))
    *_, segmentation, inpainting = models_used(run, [{"lattice": {}}])
    assert (segmentation.file, segmentation.title) == ("segformer.onnx", "segmentation network of the block")
    assert (inpainting.file, inpainting.card) == ("lama.onnx", None)
    assert inpainting.sha256 == hashlib.sha256(b"lama").hexdigest()
    assert models.files == (tmp_path / "segformer.onnx", tmp_path / "lama.onnx")


def record(unit: str, status: str = "done", at: float = 0, seconds: float = 2.0, **more: Any) -> dict[str, Any]:
    return {"unit": unit, "status": status, "started": START + at, "seconds": {"a": seconds}, "key": unit} | more


def test_streets_in_all_their_states() -> None:
    streets = [Street(f"s{i}", None, LineString([(0, i), (30, i)])) for i in range(5)]
    plan = cast(
        Any,
        SimpleNamespace(
            streets=streets,
            street_viewpoints=lambda street: [None] * [2, 1, 1, 1, 0][street],
        ),
    )
    held = [
        record("s0", at=50, files={"street_views/a/0": "one", "street_views/a/1": "two"}),
        record("s1", "stale", reason="its geometry changed"),
        record("s2", "failed", reason="viewpoint 0: no"),
        None,
        None,
    ]
    done, stale, failed, waiting, unseen = street_facts(plan, cast(Any, held))
    assert (done.state, done.viewpoints, done.viewpoints_done) == ("done", 2, 2)
    assert (done.seconds, done.key, done.updated) == (2.0, "s0", datetime.fromtimestamp(START + 52, UTC))
    assert (stale.state, stale.viewpoints_done, stale.reason) == ("stale", 0, "its geometry changed")
    assert (failed.state, failed.reason) == ("failed", "viewpoint 0: no")
    assert (waiting.state, waiting.key, waiting.viewpoints_done) == ("waiting", None, 0)
    assert (unseen.state, unseen.viewpoints) == ("unseen", 0)


def test_a_run_is_the_work_in_its_journals() -> None:
    journals = {
        "facades": [record("a"), record("b", "failed", at=10), None],
        "streets": [record("s", "stale", at=100, seconds=3.5)],
        "poses": [],
    }
    facts = run_facts(journals, datetime.fromtimestamp(START - 5, UTC))
    assert facts.units == {"facades": {"done": 1, "failed": 1, "waiting": 1}, "streets": {"stale": 1}}
    assert (facts.started.timestamp(), facts.ended.timestamp(), facts.seconds) == (START - 5, START + 103.5, 7.5)


def test_neighbours_cover_one_outline_and_courtyards_stay() -> None:
    court = shapely.box(0, 0, 30, 30).difference(shapely.box(10, 10, 20, 20))
    outline = _block_outline([court, shapely.box(30.05, 0, 40, 30), shapely.box(50, 0, 60, 30)])
    other, terrace = sorted(outline.geoms, key=lambda part: part.area)
    assert terrace.area == pytest.approx(40 * 30 - 100, abs=0.1)
    assert len(terrace.interiors) == 1, "the crack of 5 cm is closed, the courtyard is not"
    assert terrace.exterior.is_ccw
    assert other.symmetric_difference(shapely.box(50, 0, 60, 30)).area < 1e-6
    assert _block_outline([court]).geom_type == "Polygon"


def facade_row(role: str, record: dict[str, Any], height_source: str = "height") -> ItemRow:
    """Build the row of the only facade of a block, 9 m by 12 m with 4 floors by the map."""
    values = {"id": "a-0", "building": 0, "height": 12.0, "width": 9.0, "floors": 4, "seen": 0.51234}
    return build_item_row(
        FacadeSource(
            block="x",
            facades=cast(Any, SimpleNamespace(**{name: [value] for name, value in values.items()})),
            index=0,
            role=role,
            buildings={"id": ["a"], "height_source": [height_source]},
            street="Lane",
            street_id="s",
            line=np.array([[0.0, 0.0], [9.0, 0.0]]),
            azimuth_deg=180.0,
            record=record,
            is_building_corrected=False,
            updated=None,
            poses={},
            code_version="1",
            config_digest="d",
        )
    )


def windows(rows: int, confidence: float = 0.9) -> list[list[Any]]:
    return [["window", 10 * c, 40 * r, 10 * c + 6, 40 * r + 20, confidence] for r in range(rows) for c in range(3)]


def fault_measures(**changes: float) -> dict[str, Any]:
    return {"foreign_share": 0.0, "doubtful_inpainting_m": 0.1} | changes


@pytest.mark.parametrize(
    ("changes", "source", "quality"),
    [
        ({}, "height", "good"),
        ({}, "default", "height-assumed"),
        (fault_measures(), "height", "good"),
        (fault_measures(foreign_share=0.2), "height", "foreign-parts"),
        (fault_measures(doubtful_inpainting_m=0.5), "height", "garbled-inpainting"),
        (fault_measures(foreign_share=0.2, doubtful_inpainting_m=0.3), "height", "foreign-parts"),
        ({"floors": 5, "floors_low": 4, "floors_high": 6}, "height", "good"),
        ({"floors": 6, "floors_low": 5, "floors_high": 7}, "height", "floors-differ"),
        ({"floors": 5}, "height", "floors-differ"),
        ({"implausible": True}, "height", "implausible-layout"),
        ({"implausible": False}, "height", "good"),
        ({"reason": "a.jpg: shows another plane; textured from b.jpg"}, "height", "rejected-picture"),
        ({"cut_kept": 0.4, "cut_found": True, "stretched": 1.2}, "height", "good"),
        ({"cut_kept": 1.0, "cut_found": False, "stretched": 1.0}, "height", "doubtful-cut"),
        ({"cut_kept": 0.9, "cut_found": True, "stretched": 0.5}, "height", "doubtful-cut"),
        ({"cut_kept": 0.9, "cut_found": True, "stretched": 1.9}, "height", "doubtful-cut"),
        (
            {"elements": [["door", 0, 0, 5, 9, 0.9]], "floors": 0} | fault_measures(doubtful_inpainting_m=0.9),
            "levels",
            "garbled-inpainting, no-windows",
        ),
    ],
)
def test_quality_says_what_to_look_at(changes: dict[str, Any], source: str, quality: str) -> None:
    made = facade_row("street", record("a", elements=windows(4), occluded=0.1, floors=4) | changes, source)
    assert made["quality"] == quality
    assert (made["floors"], made["levels"]) == (changes.get("floors") or 4, 4)
    assert facade_row("street", record("a", "failed"), source)["quality"] is None


def test_visible_share_of_plan_is_a_column() -> None:
    assert facade_row("street", record("a", "failed"))["visible"] == 0.5123


def test_backs_from_an_exemplar_have_the_floors_that_they_are_composed_with() -> None:
    counted = record("a", elements=windows(4), floors=5)
    assert facade_row("back", counted)["floors"] == 4
    of_photo = counted | {"floors_low": 4, "floors_high": 6}
    assert facade_row("back", of_photo)["floors"] == 5


def test_each_quality_flag_has_a_remedy_on_the_page() -> None:
    page = (Path(flows.viewer.__file__).parent / "page" / "columns.js").read_text(encoding="utf-8")
    assert [flag for flag in QUALITY_CHECKS if f'"{flag}": (' not in page] == []


def test_sources_of_a_block_file(tmp_path: Path) -> None:
    (tmp_path / "city.osm.pbf").write_bytes(b"map")
    (tmp_path / "streets.geojson").write_text("{}")
    (tmp_path / "wanted").mkdir()
    block = tmp_path / "block.yaml"
    block.write_text(
        "name: x\nbuildings: {path: city.osm.pbf}\nstreets: {path: streets.geojson}\n"
        "imagery: {exemplars: {path: wanted}}\n"
    )
    assert [(s.key, s.name, s.licence) for s in block_data_sources(block)] == [
        ("buildings.path", "city.osm.pbf", OPENSTREETMAP),
        ("streets.path", "streets.geojson", None),
        ("imagery.exemplars.path", "wanted", None),
    ]
    (tmp_path / "streets.geojson").unlink()
    assert block_data_sources(block) == ()


def test_painted_pictures_have_the_licence_of_the_project_until_one_is_added(tmp_path: Path) -> None:
    block = write_demo(tmp_path)
    pictures = {"imagery.exemplars.path": tmp_path / "exemplars", "imagery.photos.path": tmp_path / "photos"}
    licences = {source.key: source.licence for source in block_data_sources(block)}
    assert [licences[key] for key in pictures] == ["the Streetloom developers, Apache-2.0"] * 2
    for folder in pictures.values():
        (folder / "own.png").write_bytes(b"own")
    licences = {source.key: source.licence for source in block_data_sources(block)}
    assert [licences[key] for key in pictures] == [None, None]


def test_the_licence_of_a_fetched_file_is_known_by_its_content(tmp_path: Path, data: Path) -> None:
    city = data / "city" / "delfshaven"
    model = next(city.glob("*.json"))
    (tmp_path / "renamed.city.json").write_bytes(model.read_bytes())
    (tmp_path / "block.yaml").write_text("name: x\nbuildings: {path: renamed.city.json}\n")
    (source,) = block_data_sources(tmp_path / "block.yaml")
    assert source.licence
    assert source.licence.startswith("Rotterdam 3D")
