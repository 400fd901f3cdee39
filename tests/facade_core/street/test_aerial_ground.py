"""A picture from above lands on roofs and ground where it belongs, and only under the free sky."""

from __future__ import annotations

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
from facade_core.geometry.overhead_view import resample_aerial_to_chart, texel_points, upward_roof_mask
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.tiled_material import TiledMaterial
from facade_core.street.surfaces import FinishSettings, KnownTexture, finish_chart

STREET = Street("s", None, shapely.LineString([(0, -9), (20, -9)]))
DENSITY = 10.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A low wide house, and a tower that stands on the middle of it."""
    houses = [
        Building("low", shapely.box(0, 0, 20, 10), 6.0, "height"),
        Building("tower", shapely.box(8, 2, 12, 8), 15.0, "height"),
    ]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=12, largest=60.0
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024))


def picture(places: np.ndarray, _side: float) -> tuple[np.ndarray, np.ndarray]:
    """Red tells the metre east, green the metre north; nothing is known west of 4 m."""
    x, y = places.T
    colour = np.column_stack([100 + 4 * np.floor(x), 100 + 4 * np.floor(y), np.full(len(x), 7.0)])
    return np.clip(colour, 0, 255).astype(np.uint8), x > 4


def roof(scene: Scene, building: int) -> int:
    return int(np.flatnonzero((scene.charts.kind == ChartKind.ROOF) & (scene.charts.building == building))[0])


def test_every_texel_takes_the_colour_of_its_place(scene: Scene) -> None:
    chart = roof(scene, 0)
    rgb, known = resample_aerial_to_chart(scene, chart, picture)
    points = texel_points(scene, chart, np.arange(known.shape[0]) + 0.5, np.arange(known.shape[1]) + 0.5)
    expected = picture(points.reshape(-1, 3)[:, :2], 0.1)[0].reshape(rgb.shape)
    np.testing.assert_array_equal(rgb[known], expected[known])
    x, y = points[..., 0], points[..., 1]
    under = (x > 8) & (x < 12) & (y > 2) & (y < 8)
    np.testing.assert_array_equal(known, (x > 4) & ~under)
    assert under.sum() > 2000
    top, seen = resample_aerial_to_chart(scene, roof(scene, 1), picture)
    assert seen.all()
    assert top[..., 2].max() == 7


def test_only_roofs_that_face_up_are_shown(scene: Scene) -> None:
    shown = upward_roof_mask(scene)
    assert (scene.charts.kind[shown] == ChartKind.ROOF).all()
    assert shown.sum() == (scene.charts.kind == ChartKind.ROOF).sum()


def test_unseen_ground_takes_the_picture_and_seen_ground_keeps_its_own(scene: Scene) -> None:
    ground = np.flatnonzero(scene.charts.kind == ChartKind.GROUND)
    # known and unknown places are both on it
    chart = next(c for c in ground.tolist() if 0 < resample_aerial_to_chart(scene, c, picture)[1][:, 20:].mean() < 1)
    shape = scene.placement.shape(chart)
    seen = np.zeros(shape, bool)
    seen[:, :20] = True

    def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        assert one == chart
        colour = np.where(seen[..., None], np.array([9, 9, 200], np.uint8), np.uint8(0))
        return colour[rows, columns], np.where(seen, Provenance.TRANSLATED, Provenance.UNSEEN).astype(np.uint8)[
            rows, columns
        ]

    materials = MaterialField(scene, [STREET], seed=0)
    colour, provenance = finish_chart(
        scene, materials, chart, KnownTexture(read, ()), FinishSettings(levelling=False, aerial=picture)
    )
    rgb, known = resample_aerial_to_chart(scene, chart, picture)
    assert (known & ~seen).sum() > 1000
    np.testing.assert_array_equal(colour[known & ~seen], rgb[known & ~seen])
    assert seen.any()
    assert (colour[seen] == [9, 9, 200]).all()
    bare = ~known & ~seen
    assert bare.any()
    np.testing.assert_array_equal(colour[bare], materials.chart_raster(chart)[bare])
    np.testing.assert_array_equal(
        provenance, np.where(seen, Provenance.TRANSLATED, np.where(known, Provenance.PHOTO, Provenance.MATERIAL))
    )


def test_roofs_take_their_material_and_nothing_else_does(scene: Scene) -> None:
    green = TiledMaterial.from_picture(np.full((32, 32, 3), (20, 220, 30), np.uint8), 0.05, DENSITY)
    plain, laid = MaterialField(scene, [STREET], seed=0), MaterialField(scene, [STREET], seed=0, roof_material=green)
    charts = np.arange(len(scene.charts))
    points = scene.charts.origin + scene.charts.axis_u + scene.charts.axis_v
    footprint = np.full(len(charts), 1 / DENSITY)
    before, after = plain.colour(charts, points, footprint), laid.colour(charts, points, footprint)
    roofs = scene.charts.kind == ChartKind.ROOF
    assert (after[roofs, 1] > 2 * after[roofs, 0].astype(int)).all()
    assert not (before[roofs] == after[roofs]).all(axis=1).any()
    np.testing.assert_array_equal(before[~roofs], after[~roofs])
