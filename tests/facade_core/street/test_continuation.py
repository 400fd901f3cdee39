"""What pictures show of the ground goes on along a street, as far as the surface goes, and never beyond what they show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.provenance import Provenance
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.continuation import (
    CONTINUATION,
    NO_DIFFERENCE,
    ContinuationSettings,
    StreetView,
    blend_street_views,
    continue_street,
)
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import FinishSettings, KnownTexture, finish_chart

STREET = Street("s", None, shapely.LineString([(-10, -8), (90, -8)]))
SETTINGS = ContinuationSettings(panorama_width=256)


@pytest.fixture(scope="module")
def scene() -> Scene:
    houses = [Building("a", shapely.box(0, 0, 80, 10), 12.0, "height")]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=20, largest=30, grid=30
    )
    placement = pack_charts(charts.size, 8, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, 8.0, page=1024))


@pytest.fixture(scope="module")
def materials(scene: Scene) -> MaterialField:
    return MaterialField(scene, [STREET], seed=1)


def viewpoints() -> list[Viewpoint]:
    return [Viewpoint(n, 0, np.array([5.0 * n, -8.0, 2.5]), np.array([1.0, 0.0])) for n in range(17)]


def ground_at(scene: Scene, x: float) -> int:
    """The piece of ground of the street at an x."""
    for chart in np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist():
        corners = scene.charts.points_at_shares(np.array([chart]), np.array([[0.0, 0.0], [1.0, 1.0]]))[0, :, :2]
        low, high = corners.min(axis=0), corners.max(axis=0)
        if (low <= (x, -8.0)).all() and (high > (x, -8.0)).all():
            return chart
    raise AssertionError(x)


def ground_pictures(
    scene: Scene, materials: MaterialField, brighter: Mapping[float, int]
) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Pictures of whole pieces of ground, by the x of each, brighter than their material."""
    found = {}
    for x, more in brighter.items():
        raster = materials.chart_raster(ground_at(scene, x)).astype(int) + more
        found[ground_at(scene, x)] = raster.clip(0, 255).astype(np.uint8), np.ones(raster.shape[:2], bool)
    return found


def continue_from_pictures(
    scene: Scene, materials: MaterialField, brighter: Mapping[float, int]
) -> dict[int, StreetView]:
    seen = [np.flatnonzero(scene.charts.kind == ChartKind.GROUND)] * len(viewpoints())
    return continue_street(scene, materials, viewpoints(), seen, ground_pictures(scene, materials, brighter), SETTINGS)


def differences_at(scene: Scene, materials: MaterialField, views: Mapping[int, StreetView], x: float) -> np.ndarray:
    """The differences that the views decided on the carriageway at an x."""
    chart = ground_at(scene, x)
    made = blend_street_views(scene, materials, chart, list(views.values()))
    step = 1 / float(scene.placement.texels_per_metre[chart])
    row, column = np.nonzero(made.views)
    place = scene.charts.points(chart, step * (column + 0.5), step * (row + 0.5))
    on = (np.abs(place[:, 0] - x) < 1) & (np.abs(place[:, 1] + 8) < 1)
    return made.difference[row[on], column[on]].astype(int) - NO_DIFFERENCE


def test_without_a_picture_nothing_is_decided(scene: Scene, materials: MaterialField) -> None:
    assert continue_from_pictures(scene, materials, {}) == {}


@pytest.mark.parametrize("at", [5.0, 75.0])
def test_a_picture_at_one_end_decides_the_whole_street(scene: Scene, materials: MaterialField, at: float) -> None:
    views = continue_from_pictures(scene, materials, {at: 18})
    assert set(views) == set(range(17))
    for x in (15.0, 45.0, 65.0):
        found = differences_at(scene, materials, views, x)
        assert len(found) > 50
        assert found.max() <= 20
        assert found.min() >= 12


def test_between_two_pictures_it_goes_from_one_to_the_other(scene: Scene, materials: MaterialField) -> None:
    views = continue_from_pictures(scene, materials, {5.0: 18, 75.0: -18})
    means = [differences_at(scene, materials, views, x).mean() for x in (30.0, 40.0, 48.0)]
    assert 18 >= means[0] > means[1] > means[2] >= -18
    assert means[0] > 1 > -1 > means[2]


def test_what_no_picture_shows_takes_the_tone_that_all_pictures_have_in_common(
    scene: Scene, materials: MaterialField
) -> None:
    """Only the carriageway is shown: pavements take less of its difference, as little is known of them."""
    pictures = ground_pictures(scene, materials, {5.0: 18})
    (chart,) = pictures
    kinds = materials.ground_kinds(chart, 0)
    road = kinds[kinds.shape[0] // 2, kinds.shape[1] // 2]
    pictures[chart] = pictures[chart][0], kinds == road
    seen = [np.flatnonzero(scene.charts.kind == ChartKind.GROUND)] * len(viewpoints())
    views = continue_street(scene, materials, viewpoints(), seen, pictures, SETTINGS)
    other = ground_at(scene, 15.0)
    made, kinds = blend_street_views(scene, materials, other, list(views.values())), materials.ground_kinds(other, 0)
    decided_here = made.views > 0
    on, beside = (made.difference[decided_here & (kinds == kind)].mean() - NO_DIFFERENCE for kind in (road, 0))
    assert 18.5 >= on > beside > 6


def test_little_evidence_changes_half(scene: Scene, materials: MaterialField) -> None:
    pictures = ground_pictures(scene, materials, {5.0: 40})
    (chart,) = pictures
    few = np.zeros(pictures[chart][1].shape, bool)
    few[100:106, 100:106] = True  # within one cell, which weighs as much as the prior
    pictures[chart] = pictures[chart][0], few
    seen = [np.flatnonzero(scene.charts.kind == ChartKind.GROUND)] * len(viewpoints())
    views = continue_street(scene, materials, viewpoints(), seen, pictures, SETTINGS)
    found = differences_at(scene, materials, views, 45.0)
    assert 0 <= found.mean() <= 22


def test_a_view_that_knows_nothing_decides_nothing(scene: Scene, materials: MaterialField) -> None:
    """The smallest of patches: pixels mix it with unknown texels, and a view without a pixel of its own says nothing."""
    pictures = ground_pictures(scene, materials, {5.0: 40})
    (chart,) = pictures
    spot = np.zeros(pictures[chart][1].shape, bool)
    spot[100:102, 100:102] = True
    pictures[chart] = pictures[chart][0], spot
    seen = [np.flatnonzero(scene.charts.kind == ChartKind.GROUND)] * len(viewpoints())
    for view in continue_street(scene, materials, viewpoints(), seen, pictures, SETTINGS).values():
        assert (view.difference[view.chart >= 0] != NO_DIFFERENCE).any()


def test_views_are_blended_in_any_order(scene: Scene, materials: MaterialField) -> None:
    views = list(continue_from_pictures(scene, materials, {5.0: 18, 75.0: -18}).values())
    chart = ground_at(scene, 45.0)
    one, other = (
        blend_street_views(scene, materials, chart, views),
        blend_street_views(scene, materials, chart, views[::-1]),
    )
    assert one.views.max() > 1
    np.testing.assert_array_equal(one.difference, other.difference)
    np.testing.assert_array_equal(one.views, other.views)


def test_a_finished_chart_keeps_its_pictures_and_its_detail(scene: Scene, materials: MaterialField) -> None:
    chart = ground_at(scene, 45.0)
    made = blend_street_views(
        scene, materials, chart, list(continue_from_pictures(scene, materials, {5.0: 18}).values())
    )
    shape = made.views.shape
    rank = np.zeros(shape, np.uint8)
    rank[:20] = Provenance.PHOTO

    def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        return np.full((*shape, 3), 90, np.uint8)[rows, columns], rank[rows, columns]

    settings = FinishSettings(differences=made, levelling=False)
    colour, provenance = finish_chart(scene, materials, chart, KnownTexture(read, {chart}), settings)
    assert (colour[:20] == 90).all()
    bare = rank == 0
    np.testing.assert_array_equal(provenance[bare] == Provenance.TRANSLATED, made.views[bare] > 0)
    plain, _ = finish_chart(scene, materials, chart, KnownTexture(read, {chart}), FinishSettings(levelling=False))
    gone = colour.astype(int) - plain
    assert (gone[bare & (made.views == 0)] == 0).all()
    at = bare & (made.views > 0) & (plain.max(axis=2) < 230)
    assert np.abs(gone[at] - (made.difference[at].astype(int) - NO_DIFFERENCE)).max() <= 1


def test_streets_hold_differences_at_their_own_density(scene: Scene) -> None:
    coarse = scene.with_density(CONTINUATION.texels_per_metre)
    assert coarse.caster is scene.caster
    assert (coarse.placement.texels_per_metre <= CONTINUATION.texels_per_metre).all()
    assert (coarse.placement.width < scene.placement.width).all()
