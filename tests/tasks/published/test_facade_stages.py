"""The stages of facades are shown alike wherever they are: the report's files and page, STAC's assets, the viewer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import lxml.html
import numpy as np
import pytest
from PIL import Image

from catalogs.features import safe_file_stem
from facade_core.core.labels import CLASSES
from facade_core.export.pictures.stage_pictures import iterate_stage_pictures, select_report_levels
from facade_core.geometry.walls import WallRole
from tasks.viewing.pictures import draw_stage_picture, list_stage_pictures
from tasks.viewing.run_view import RunReader, RunView


@pytest.fixture(scope="module")
def view(undisturbed: tuple[Path, dict[str, Any]]) -> RunView:
    return RunReader(undisturbed[0]).open_newest()


def test_the_report_has_the_stages_in_their_order_and_stac_has_their_names(
    view: RunView, undisturbed: tuple[Path, dict[str, Any]]
) -> None:
    report = Path(undisturbed[1]["outputs"]["report"])
    pages = [lxml.html.document_fromstring(path.read_text("utf-8")) for path in report.parent.rglob("streets/*/*.html")]
    shown = {one.get("id"): one.findall(".//figure") for page in pages for one in page.iter("details")}
    for page in pages:
        (legend,) = page.find_class("legend")
        assert [span.text_content() for span in legend.iter("span")] == list(CLASSES)
    files, photos = set(), 0
    for index, facade in enumerate(view.tables.facades.id):
        if view.tables.facades.role[index] != WallRole.STREET:
            assert facade not in shown
            continue
        declared = [stage.report for stage in iterate_stage_pictures(view.open_facade(index)) if stage.report]
        assert [figure.findtext("figcaption") for figure in shown[facade]] == [stage.title for stage in declared]
        names = [f"{safe_file_stem(facade)}-{stage.name}.webp" for stage in declared]
        assert [figure.find("img").get("src") for figure in shown[facade]] == [f"../../images/{name}" for name in names]
        if "cut_kept" in view.records[index]:
            assert sum(stage.title.startswith("Photo") for stage in declared) == 1, "what was cut out is shown"
            photos += 1
        files |= set(names)
        building = view.tables.buildings["id"][int(view.tables.facades.building[index])]
        item = report.parents[1] / "stac" / "facades" / safe_file_stem(building) / f"{safe_file_stem(facade)}.json"
        assets = json.loads(item.read_text())["assets"]
        assert set(assets) == {stage.name for stage in declared}
        assert [name for name, asset in assets.items() if "thumbnail" in asset["roles"]] == ["result"]
    assert photos
    of_exemplars = {path.name for path in (report.parent / "images").glob("exemplar-*.webp")}
    assert files == {path.name for path in (report.parent / "images").glob("*.webp")} - of_exemplars


def test_both_draw_the_same_picture_of_a_stage_that_both_show(
    view: RunView, undisturbed: tuple[Path, dict[str, Any]]
) -> None:
    images = Path(undisturbed[1]["outputs"]["report"]).parent / "images"
    index = next(i for i, record in enumerate(view.records) if record and record.get("occluded"))
    both = [
        (stage.viewer, stage.report)
        for stage in iterate_stage_pictures(view.open_facade(index))
        if stage.viewer and stage.report
    ]
    assert [here.name for here, _ in both] == ["hidden", "lattice", "texture", "sample"]
    for here, there in both:
        kept = np.asarray(Image.open(images / f"{safe_file_stem(view.tables.facades.id[index])}-{there.name}.webp"))
        assert np.abs(draw_stage_picture(view, index, here.name).astype(int) - kept).mean() < 8, here.name


def test_a_facade_that_is_not_done_has_none(view: RunView) -> None:
    view.journals["facades"][0], record = {"status": "failed"}, view.journals["facades"][0]
    assert list_stage_pictures(view, 0) == []
    view.journals["facades"][0] = record
    names = [stage.name for stage in list_stage_pictures(view, 0)]
    assert len(set(names)) == len(names) > 6


def test_the_levels_of_the_report() -> None:
    assert [select_report_levels(n) for n in (0, 1, 2, 3, 12)] == [[], [0], [0, 1], [0, 1, 2], [0, 6, 11]]
