"""`catalogs.open` on a run that really published."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

import catalogs
from catalogs.block.reader import read_block
from facade_core.atlas.journal import read_journal, write_record
from facade_core.atlas.snapshot import open_atlas
from facade_core.atlas.store import BRANCH, commit, open_repository
from facade_core.core.errors import InputError
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.imagery.privacy import BLUR_CELL_M
from facade_core.parsing.segmenter import parse
from tasks.engine.run_key import create_run
from tasks.publish.task import publish_block


def test_search_and_facade(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    catalogue = catalogs.open(undisturbed[0])
    every = catalogue.search()
    assert len(every) == undisturbed[1]["facades_done"]
    some = catalogue.search("photo > 0")
    assert 0 < len(some) < len(every)
    assert some.crs.to_epsg() == 4326
    west, south, east, north = some.total_bounds
    assert set(some["id"]) <= set(catalogue.search(bbox=(west, south, east, north))["id"])

    row = some.iloc[0]
    facade = catalogue.facade(row["id"])
    assert float(facade.x[-1] + facade.x[0]) == pytest.approx(row["width_m"], abs=0.2)
    assert float(facade.y[-1] + facade.y[0]) == pytest.approx(row["height_m"], abs=0.2)
    assert float(facade.occluded.mean()) == pytest.approx(row["occluded"], abs=1e-3)
    assert float((facade.provenance == Provenance.PHOTO).mean()) == pytest.approx(row["photo"], abs=1e-3)
    assert sum(e[0] == "window" for e in json.loads(facade.attrs["elements"])) == row["windows"]
    seen = ~facade.occluded.values
    assert np.abs(facade.evidence.values[seen].astype(int) - facade.texture.values[seen]).mean() < 1

    assert row["privacy"] == "blur"
    cell = round(BLUR_CELL_M / abs(float(facade.x[1] - facade.x[0])))
    squares, colours = np.argwhere(~seen) // cell, facade.evidence.values[~seen]
    each = np.unique(squares, axis=0)
    assert len(np.unique(np.hstack([squares, colours]), axis=0)) == len(each), "one colour in each half metre"

    published = (undisturbed[0] / "current").read_text().strip()
    same = open_atlas(undisturbed[0], chunks=None).at(published).facade(row["id"])
    for name in ("colour", "provenance", "labels", "occluded", "y", "x"):
        np.testing.assert_array_equal(same[name], facade[name])
    for name in ("origin", "axis_x", "axis_y", "crs", "elements"):
        assert same.attrs[name] == facade.attrs[name]


def test_labels_layout_and_picture_of_a_facade_agree(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    """Read back from what is published: the columns, the boxes of elements, the label raster and the texture say the same."""
    catalogue = catalogs.open(undisturbed[0])
    fronts = catalogue.search("role = 'street' and status = 'done'")
    parsed = 0
    for _, row in fronts.iterrows():
        facade = catalogue.facade(row["id"])
        labels, texture = facade.labels.values, facade.texture.values
        assert float((labels == FacadeClass.WINDOW).mean()) == pytest.approx(row["window_to_wall"], abs=1e-3)
        assert float((labels == FacadeClass.SHOP).any(axis=0).mean()) == pytest.approx(row["shop_width"], abs=1e-3)
        found = json.loads(facade.attrs["elements"])
        in_boxes = np.zeros(labels.shape, bool)
        for name, x0, y0, x1, y1, *_ in found:
            box = np.s_[max(0, round(y0)) : round(y1), max(0, round(x0)) : round(x1)]
            if name == "window":
                # a balcony may hide a part of it, and the box of a door beside reach into it
                assert np.isin(labels[box], (FacadeClass.WINDOW, FacadeClass.BALCONY, FacadeClass.DOOR)).mean() > 0.8, (
                    f"a window of {row['id']} without its label"
                )
                in_boxes[box] = True
        windows = labels == FacadeClass.WINDOW
        assert (in_boxes & windows).sum() > 0.8 * windows.sum(), f"{row['id']} has windows that are no elements"
        if parsed < 2 and windows.any():
            parsed += 1
            again = parse(texture).labels
            both = (again == FacadeClass.WINDOW) & windows
            assert both.sum() > 0.6 * windows.sum(), f"where {row['id']} is labelled window its texture shows one"
    assert parsed


def test_a_later_snapshot_is_published_beside_the_first(
    undisturbed: tuple[Path, dict[str, Any]], block: Path, tmp_path: Path
) -> None:
    """Also where the first was published without its Collections, as an earlier version did."""
    out = tmp_path / "out"
    shutil.copytree(undisturbed[0], out, ignore=shutil.ignore_patterns("prefect"))
    run = create_run(read_block(block), out)
    first = (out / "current").read_text().strip()
    shutil.rmtree(out / "published" / first / "stac" / "runs")
    publish_block.fn(run, block)
    stac = out / "published" / first / "stac"
    block_item = json.loads((stac / "blocks" / "helsinki.json").read_text())["properties"]
    assert {source["key"] for source in block_item["streetloom:sources"]} >= {"buildings.path", "streets.path"}
    assert block_item["streetloom:facades_done"] == undisturbed[1]["facades_done"]
    said = json.loads((stac / "runs" / "run.json").read_text())["properties"]
    assert said["streetloom:units"]["facades"] == {"done": undisturbed[1]["facades_done"]}
    assert said["start_datetime"] < said["end_datetime"]
    assert {path.stem for path in (stac / "models").glob("*.md")} == {"network", "layouts", "layout_network"}

    session = open_repository(out / "store").writable_session(BRANCH)
    group = zarr.open_group(session.store)
    record = read_journal(group, "streets")[0]
    assert record is not None
    write_record(group, "streets", 0, record | {"status": "stale", "reason": "visible surfaces changed"})
    commit(session, "a street that is out of date")
    publish_block.fn(run, block)
    second = (out / "current").read_text().strip()
    assert second != first
    street = json.loads((out / "published" / second / "stac" / "streets" / f"{record['unit']}.json").read_text())
    assert street["properties"]["streetloom:status"] == "stale"
    (earlier,) = [link["href"] for link in street["links"] if link["rel"] == "predecessor-version"]
    held = (out / "published" / second / "stac" / "streets" / earlier).resolve()
    assert held == (stac / "streets" / f"{record['unit']}.json").resolve()
    assert json.loads(held.read_text())["properties"]["deprecated"] is True


def test_what_is_not_there(undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no facade nowhere"):
        catalogs.open(undisturbed[0]).facade("nowhere")
    with pytest.raises(InputError, match="nothing is published"):
        catalogs.open(tmp_path)
