"""Streets: who sees what pictures show goes on from it, who does not has nothing to do, and keys tell all that counts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
import zarr

from catalogs.readers.pictures.materials import MaterialPicture
from facade_core.atlas.journal import read_journal
from facade_core.atlas.rasters import read_chart_raster
from facade_core.atlas.store import open_repository
from facade_core.core.errors import StoreError
from facade_core.core.provenance import Provenance
from facade_core.core.types import SURFACES, GroundArea
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.plan_tables import read_plan
from facade_core.street.continuation import StreetView
from tasks.engine.inputs import digest_inputs, join_key
from tasks.engine.unit import Unit
from tasks.stages.shared.street_views import StoredView, list_stored_views
from tasks.stages.streets.stage import list_street_units
from tasks.stages.streets.worker import StreetInputs, compute_street, write_street
from tests.keys import differing_inputs
from tests.pipeline.painted_panoramas import write_panorama_block, write_panoramas
from tests.pipeline.stages import Textured, texture

CAMERAS = {"a-1": (8.0, -1.0, 2.5), "a-2": (12.5, 0.5, 2.5)}


@pytest.fixture(scope="module")
def textured(tmp_path_factory: pytest.TempPathFactory) -> Textured:
    """A block with panoramas of the ground of one street; the other is far away."""
    folder = tmp_path_factory.mktemp("streets")
    write_panoramas(folder / "in", CAMERAS)
    return texture(write_panorama_block(folder / "in"), folder / "out", stop_before="pages")


@pytest.fixture(scope="module")
def store(textured: Textured) -> Any:
    session = open_repository(Path(textured.run.out) / "store").readonly_session("main")
    return SimpleNamespace(group=zarr.open_group(session.store, mode="r"), plan=read_plan(session))


def inputs_of(textured: Textured, store: Any, street: int, run: Any = None, plan: Any = None) -> StreetInputs:
    block: Any = None
    units = list_street_units(run or textured.run, block, plan or store.plan, store.group)
    return units[street].inputs


def test_a_street_goes_on_from_pictures_and_one_without_has_nothing_to_do(textured: Textured, store: Any) -> None:
    records = [record or {} for record in read_journal(store.group, "streets")]
    seen = {record["unit"]: len(record["files"]) for record in records}
    assert seen["s1"] == len(store.plan.street_viewpoints([s.id for s in store.plan.streets].index("s1")))
    assert seen["s3"] == 0
    far = [street.id for street in store.plan.streets].index("s3")
    assert inputs_of(textured, store, far).view.charts == ()
    assert compute_street(inputs_of(textured, store, far)) == {}


def test_what_views_decided_is_what_is_translated(store: Any) -> None:
    plan = store.plan
    ground = np.flatnonzero(plan.scene.charts.kind == ChartKind.GROUND).tolist()
    found = set()
    for chart in range(len(plan.ids)):
        views, provenance = (
            read_chart_raster(store.group, plan.scene.placement, chart, f"atlas/{name}")
            for name in ("street_views", "provenance")
        )
        np.testing.assert_array_equal(views > 0, provenance == Provenance.TRANSLATED)
        if views.any():
            assert chart in ground
        found |= set(views.ravel().tolist())
    assert {0, 1, 2} <= found, "texels are decided by one view and by several"


def test_a_view_is_read_as_it_was_written_when_charts_have_other_numbers(store: Any) -> None:
    plan, group = store.plan, zarr.create_group({})
    rng = np.random.default_rng(1)
    chart = rng.integers(-1, len(plan.ids), (16, 32)).astype(np.int32)
    place = Viewpoint(0, 0, np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0]))
    view = StreetView(place, rng.integers(0, 256, (16, 32, 3)).astype(np.uint8), chart, (chart % 7).astype(np.uint8))
    atlas: Any = SimpleNamespace(plan=plan, group=group)
    unit: Any = Unit(0, "s", None)
    ((path, digest),) = write_street(atlas, unit, {4: view})["files"].items()  # type: ignore[attr-defined]
    stored = StoredView(path, digest, "s", 4, (1.0, 2.0, 3.0), (0.0, 1.0))
    order = rng.permutation(len(plan.ids))
    other: Any = SimpleNamespace(ids=plan.ids[order])
    again = stored.read(group, other).with_viewpoint_id(9)
    assert again.viewpoint.id == 9
    np.testing.assert_array_equal(again.difference, view.difference)
    np.testing.assert_array_equal(again.kind, view.kind)
    np.testing.assert_array_equal(np.where(again.chart < 0, -1, order[again.chart]), chart)
    gone: Any = SimpleNamespace(ids=plan.ids[1:])
    np.testing.assert_array_equal(stored.read(group, gone).chart, np.where(chart > 0, chart - 1, -1))
    group[path][0, 0, 0] += 1
    with pytest.raises(StoreError, match="not as it was written"):
        stored.read(group, plan)


CHANGES: dict[str, tuple[Callable[[Any, Any], tuple[Any, Any]], str]] = {
    "what a viewpoint sees": (
        lambda run, plan: (run, replace(plan, view_digests=("another",) * len(plan.view_digests))),
        "view",
    ),
    "spacing": (lambda run, plan: (run, replace(plan, scene=replace(plan.scene, spacing=7.0))), "view"),
    "seed": (lambda run, plan: (replace(run, settings=run.settings.model_copy(update={"seed": 9})), plan), "seed"),
    "materials": (
        lambda run, plan: (replace(run, materials=(MaterialPicture("slabs", Path(__file__), 1.0),)), plan),
        "materials",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_key_tells_what_a_street_depends_on(textured: Textured, store: Any, name: str) -> None:
    near = [street.id for street in store.plan.streets].index("s1")
    change, told = CHANGES[name]
    run, plan = change(textured.run, store.plan)
    for street, expected in ((near, [told]), (1 - near, [])):
        before, now = (
            join_key(digest_inputs(one))
            for one in (inputs_of(textured, store, street), inputs_of(textured, store, street, run, plan))
        )
        assert differing_inputs(before, now) == expected


def test_a_key_tells_which_pictures_a_street_sees(textured: Textured, store: Any) -> None:
    near = [street.id for street in store.plan.streets].index("s1")
    inputs = inputs_of(textured, store, near)
    changed = replace(inputs.pictured, known=("another",))
    before, now = (join_key(digest_inputs(one)) for one in (inputs, replace(inputs, pictured=changed)))
    assert differing_inputs(before, now) == ["pictured"]


def test_a_key_tells_the_surface_of_ground_from_which_others_learn(textured: Textured, store: Any) -> None:
    """Its pictures stay as they are, and stand for another surface of the map."""
    near = [street.id for street in store.plan.streets].index("s1")
    area = GroundArea("paved", shapely.box(*shapely.total_bounds(store.plan.scene.charts.boxes)), SURFACES[0])
    other = replace(store.plan, ground=replace(store.plan.ground, areas=(area,)))
    before, now = (
        join_key(digest_inputs(one))
        for one in (inputs_of(textured, store, near), inputs_of(textured, store, near, plan=other))
    )
    assert "pictured_ground" in differing_inputs(before, now)


def test_views_of_a_block_are_listed_by_viewpoint(store: Any) -> None:
    views = list_stored_views(store.plan, store.group)
    street = [street.id for street in store.plan.streets].index("s1")
    assert sorted(views) == [viewpoint.id for viewpoint in store.plan.street_viewpoints(street)]
    assert [views[one].number for one in sorted(views)] == list(range(len(views)))
