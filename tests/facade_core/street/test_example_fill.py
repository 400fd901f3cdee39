"""Ground goes on by example: what repeats goes on as it is, kinds of ground keep to themselves, and nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, GroundWay, MappedGround, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.street.materials.example_fill import fill_by_example
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.settings import EXAMPLE_FILL

DENSITY = 16.0
SIZE = (240, 320)


def slabs(seed: int = 0) -> np.ndarray:
    """Slabs of 13 by 20 texels with joints, and the grain of each."""
    rows, columns = np.indices(SIZE)
    rng = np.random.default_rng(seed)
    tone = 150 + rng.normal(0, 5, (40, 40))[rows // 13, columns // 20] + rng.normal(0, 2, SIZE)
    joint = (rows % 13 == 0) | (columns % 20 == 0)
    return np.clip(np.where(joint, 80, tone)[..., None] * [1.0, 0.95, 0.9], 0, 255).astype(np.uint8)


def anything() -> np.ndarray:
    return np.ones(SIZE, bool)


def test_joints_go_on_where_they_would_be() -> None:
    image, known = slabs(), anything()
    known[90:150, 126:206] = False
    out, filled = fill_by_example(
        np.where(known[..., None], image, 0), known, anything(), np.zeros(SIZE, np.uint8), DENSITY
    )
    np.testing.assert_array_equal(filled, ~known)
    np.testing.assert_array_equal(out[known], image[known])
    plain = np.broadcast_to(image[known].mean(axis=0), image[~known].shape)
    off, off_plain = (np.abs(one - image[~known]).mean() for one in (out[~known].astype(float), plain))
    assert off < 0.7 * off_plain


def test_each_kind_goes_on_with_its_own() -> None:
    """A road between pavements; across all of them a strip is hidden."""
    kind = np.zeros(SIZE, np.uint8)
    kind[100:160] = 1
    image = np.where(kind[..., None] == 1, np.random.default_rng(1).normal(70, 6, (*SIZE, 3)), slabs()).astype(np.uint8)
    known = anything()
    known[:, 206:266] = False
    out, filled = fill_by_example(np.where(known[..., None], image, 0), known, anything(), kind, DENSITY)
    assert filled[:, 206:256].all()
    assert abs(out[104:156, 206:256].mean() - 70) < 6
    assert abs(out[20:90, 206:256].mean() - image[20:90].mean()) < 8


def test_it_ends_a_little_way_from_pictures_and_where_no_ground_is() -> None:
    known, there = np.zeros(SIZE, bool), anything()
    known[:, :120], there[:40] = True, False
    _, filled = fill_by_example(slabs(), known, there, np.zeros(SIZE, np.uint8), DENSITY)
    reach = round(EXAMPLE_FILL.max_fill_m * DENSITY)
    assert filled[40:, 120 : 120 + reach - 1].all()
    assert not filled[:, 120 + reach + 1 :].any()
    assert not filled[:40].any()


@pytest.mark.parametrize("seen", [0, 6, SIZE[1]], ids=["nothing", "a strip", "all"])
def test_without_an_example_or_a_hole_nothing_changes(seen: int) -> None:
    known = np.zeros(SIZE, bool)
    known[:, :seen] = True
    out, filled = fill_by_example(slabs(), known, anything(), np.zeros(SIZE, np.uint8), DENSITY)
    np.testing.assert_array_equal(out, slabs())
    assert not filled.any()


def test_kinds_lie_where_the_map_has_them() -> None:
    """A road 6 m wide with a pavement of 2 m at its left."""
    road = GroundWay("r", shapely.LineString([(-40, -10), (60, -10)]), "road", 6.0, "asphalt", pavement=(2.0, 0.0))
    charts, mesh, _ = build_block_surfaces(
        [Building("a", shapely.box(0, 0, 20, 10), 12.0, "height")],
        [Street("r", None, road.line)],
        terrain=build_terrain([], None),
        ground_margin=30,
        largest=32,
        grid=32,
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024), names=("a",))
    materials = MaterialField(scene, [], seed=1, ground=MappedGround((road,)))
    found = set()
    for chart in np.flatnonzero(charts.kind == ChartKind.GROUND).tolist():
        kinds = materials.ground_kinds(chart, 12)
        height, width = placement.shape(chart)
        assert kinds.shape == (height + 24, width + 24)
        x, y = np.meshgrid(np.arange(-12, width + 12) + 0.5, np.arange(-12, height + 12) + 0.5)
        east, north = np.moveaxis(charts.points(chart, x / 10, y / 10)[..., :2], -1, 0)
        inside = (east > -38) & (east < 58)
        strips = (np.abs(north + 10) < 2.8, (north > -6.8) & (north < -5.2), (north < -13.3) | (north > -4.7))
        for own in strips:
            assert len(np.unique(kinds[own & inside])) <= 1
        found |= {(int(kinds[own & inside][0]), n) for n, own in enumerate(strips) if (own & inside).any()}
    assert len(found) == 3
    assert len({kind for kind, _ in found}) == 3
