"""A plan whose geometry is that of the last ingest is taken from the store, and is the one that would be made anew."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from catalogs.block.reader import Block, read_block
from catalogs.block.settings import replace_settings
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import InputError
from facade_core.geometry.chart_packing import PreviousChartPlacements
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from flows.block import _publish_connection
from tasks.engine.compute.connect import Compute, connect
from tasks.engine.compute.distributed_map import MIN_RUN_ITEMS, map_on_workers
from tasks.engine.progress import StageProgress, add_listener
from tasks.engine.run_key import create_run
from tasks.stages.ingest import task as stage
from tasks.stages.ingest.planning import make_plan, plan_reuse_key, update_plan_panoramas
from tasks.stages.ingest.task import ingest_block
from tests.pipeline.stages import EAST, NORTH, STREETS, write_block, write_photo


def ingested(block: Path, out: Path) -> tuple[Block, Plan]:
    out.mkdir(exist_ok=True)
    read = read_block(block)
    ingest_block.fn(create_run(read, out), read)
    return read, read_plan(open_repository(out / "store").readonly_session(BRANCH))


def add_panorama(folder: Path, z: float | None, rows: int = 256) -> Path:
    """One panorama on street 1 to the block in a folder."""
    (folder / "panoramas").mkdir()
    noise = np.random.default_rng(1).integers(0, 255, (rows, 2 * rows, 3)).astype(np.uint8)
    Image.fromarray(noise).save(folder / "panoramas" / "p.jpg")
    place = {"x": EAST + 10, "y": NORTH, "heading": 20.0, **({} if z is None else {"z": z})}
    (folder / "poses.json").write_text(json.dumps({"crs": "EPSG:32635", "poses": {"p.jpg": place}}))
    keys = yaml.safe_load((folder / "block.yaml").read_text())
    keys["imagery"]["panoramas"] = {"path": "panoramas", "poses": "poses.json"}
    (folder / "block.yaml").write_text(yaml.safe_dump(keys))
    return folder / "block.yaml"


def assert_equal(one: Any, other: Any) -> None:
    """Values of the same type with the same fields, to the bit."""
    if is_dataclass(one):
        assert type(one) is type(other)
        for field in fields(one):
            assert_equal(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_equal(*pair)
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other


@pytest.mark.parametrize("z", [None, 2.5])
def test_with_a_panorama_more_it_is_the_plan_made_anew(tmp_path: Path, z: float | None) -> None:
    first, before = ingested(write_block(tmp_path / "in"), tmp_path / "out")
    second = read_block(add_panorama(tmp_path / "in", z))
    assert plan_reuse_key(second) == plan_reuse_key(first)
    again = update_plan_panoramas(second, before)
    assert len(again.sightings.facade)
    assert_equal(again, make_plan(second, PreviousChartPlacements(before.ids, before.scene.placement)))


def test_a_sharp_panorama_raises_facades_in_the_plan_of_the_store_as_in_one_made_anew(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    first, before = ingested(write_block(folder, texture={"texels_per_metre": 8}), out)
    second = read_block(add_panorama(folder, 2.5, 1024))
    places = PreviousChartPlacements(before.ids, before.scene.placement)
    _, raised = ingested(folder / "block.yaml", out)
    assert_equal(raised, make_plan(second, places))
    finer = np.flatnonzero(raised.scene.placement.texels_per_metre != before.scene.placement.texels_per_metre)
    assert len(finer)
    assert set(finer.tolist()) <= set(raised.facades.chart[raised.sightings.facade].tolist())
    assert raised.view_digests == before.view_digests
    again = update_plan_panoramas(first, raised)
    assert_equal(again, make_plan(first, PreviousChartPlacements(raised.ids, raised.scene.placement)))
    assert (again.ids == before.ids).all()


def test_what_is_seen_is_looked_for_again_only_where_geometry_or_settings_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    monkeypatch.setattr(stage, "make_plan", lambda *of: made.append(of) or make_plan(*of))
    ingested(write_block(tmp_path / "in"), tmp_path / "out")
    assert len(made) == 1
    write_photo(tmp_path / "in", "a-0", 1)
    block, plan = ingested(write_block(tmp_path / "in"), tmp_path / "out")
    assert block.photos
    assert len(made) == 1
    assert_equal(plan, make_plan(block))
    for number, change in enumerate(
        ({"storey": 3.0}, {"texture": {"viewpoint_height": 2.0}}, {"streets": STREETS | {"1": [(0, 0), (40, 0)]}}), 2
    ):
        block, plan = ingested(write_block(tmp_path / "in", **change), tmp_path / "out")
        assert len(made) == number
        assert open_root(open_repository(tmp_path / "out" / "store").readonly_session(BRANCH)).attrs[
            "plan"
        ] == plan_reuse_key(block)


def test_a_plan_whose_rays_are_cast_by_workers_is_the_same(tmp_path: Path) -> None:
    block = write_block(tmp_path / "in", streets=STREETS)
    _, alone = ingested(block, tmp_path / "alone")
    out, read = tmp_path / "out", read_block(block)
    out.mkdir()
    ready: Future[Compute] = Future()
    with connect(2, None, str(out)) as compute:
        ready.set_result(compute)
        told: list[StageProgress] = []
        stop = add_listener(told.append)
        ingest_block.fn(create_run(read, out), read, partial(map_on_workers, ready))
        stop()
    rays = [event.finished for event in told if event.stage == "rays" and event.total == len(alone.viewpoints)]
    assert (rays[0], rays[-1]) == (0, len(alone.viewpoints))
    assert len(alone.viewpoints) > MIN_RUN_ITEMS, "there is more than one run of them"
    assert_equal(read_plan(open_repository(out / "store").readonly_session(BRANCH)), alone)


def test_who_waits_for_workers_that_do_not_come_is_told() -> None:
    ready: Future[Compute] = Future()

    @contextmanager
    def nowhere() -> Iterator[Compute]:
        raise InputError("no scheduler")
        yield

    with pytest.raises(InputError, match="no scheduler"), _publish_connection(nowhere(), ready):
        pass
    with pytest.raises(CancelledError):
        ready.result(1)


def test_other_code_makes_the_plan_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    block = read_block(write_block(tmp_path / "in"))
    key = plan_reuse_key(block)
    assert plan_reuse_key(replace(block, settings=replace_settings(block.settings, seed=99), photos={})) == key
    monkeypatch.setattr("tasks.stages.ingest.planning.stage_code_digest", lambda stage: "other")
    assert plan_reuse_key(block) != key


def test_the_number_of_facades_does_not_depend_on_the_resolution(tmp_path: Path) -> None:
    found = {}
    for texels in (1, 16):
        block = write_block(tmp_path / f"{texels}", texture={"texels_per_metre": texels})
        found[texels] = set(ingested(block, tmp_path / f"out-{texels}")[1].facades.id)
    assert found[1] == found[16]
