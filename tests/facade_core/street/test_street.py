"""Render, translate and propagate on a painted street with a known answer."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
import shapely

from benchmarks.papers.translator.translators import MaterialFieldTranslator
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import GeometryError
from facade_core.core.provenance import Provenance
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.daylight import ChartDaylight
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.geometry.visible_tiles import mark_visible_texel_tiles
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer

STREET = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
BUILDINGS = [
    Building("a", shapely.box(0, 0, 20, 10), 12.0, "height"),
    Building("behind", shapely.box(0, 14, 20, 20), 30.0, "height"),
]


@pytest.fixture(scope="module")
def scene() -> Scene:
    charts, mesh, _ = build_block_surfaces(
        BUILDINGS, [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024))


def camera(x: float = 10.0) -> Viewpoint:
    return Viewpoint(0, 0, np.array([x, -8.0, 2.5]), np.array([1.0, 0.0]))


def window(scene: Scene, writable, seed=None, evidence=None) -> TexelBuffer:
    rasters, write = TexelBuffer.plan_layout(scene.placement, writable, range(len(scene.charts)))
    seed = np.zeros((rasters.total, 3), np.uint8) if seed is None else seed
    evidence = np.zeros(rasters.total, np.uint8) if evidence is None else evidence
    return TexelBuffer.allocate(scene.placement, rasters, write, seed, evidence)


def south_wall(scene: Scene, building: int) -> int:
    charts = scene.charts
    return int(
        np.flatnonzero(
            (charts.building == building) & (charts.kind == ChartKind.WALL) & (charts.normals()[:, 1] < -0.9)
        )[0]
    )


def test_untextured_is_grey_and_sky_black(scene: Scene) -> None:
    panorama = render_panorama(scene, window(scene, []), camera(), (64, 128))
    assert not panorama.textured.any()
    assert (panorama.rgb[panorama.chart < 0][~np.isfinite(panorama.depth[panorama.chart < 0])] == 0).all()
    seen = panorama.rgb[panorama.chart >= 0]
    assert (np.ptp(seen.astype(int), axis=1) == 0).all()
    assert seen.min() > 100


def test_depth_and_points_are_metres(scene: Scene) -> None:
    panorama = render_panorama(scene, window(scene, []), camera(), (128, 256))
    wall = panorama.chart == south_wall(scene, 0)
    assert panorama.depth[wall].min() == pytest.approx(8.0, rel=1e-3)
    np.testing.assert_allclose(panorama.points[wall][:, 1], 0, atol=1e-3)


def test_what_is_propagated_is_rendered_again(scene: Scene) -> None:
    """A gradient painted on the wall survives the way panorama -> atlas -> panorama."""
    wall = south_wall(scene, 0)
    atlas = window(scene, [wall])
    first = render_panorama(scene, atlas, camera(), (256, 512))
    rgb = first.rgb.copy()
    on_wall = first.chart == wall
    rgb[on_wall] = np.clip(first.points[on_wall] * [10, 0, 15] + [20, 128, 30], 0, 255).astype(np.uint8)
    propagate_panorama(scene, atlas, camera(), rgb, charts_seen=first.chart)
    second = render_panorama(scene, atlas, camera(), (256, 512))
    again = second.textured & on_wall
    assert again.sum() > 0.97 * on_wall.sum()
    assert np.abs(second.rgb[again].astype(int) - rgb[again]).mean() < 2


def test_nothing_bleeds_through_an_occluder(scene: Scene) -> None:
    """The wall behind takes no colour where the front building hides it, and none of the front building's."""
    hidden, front = south_wall(scene, 1), south_wall(scene, 0)
    atlas = window(scene, [hidden])
    first = render_panorama(scene, atlas, camera(), (256, 512))
    rgb = np.zeros((256, 512, 3), np.uint8)
    rgb[first.chart == front] = [255, 0, 0]
    rgb[first.chart == hidden] = [0, 255, 0]
    propagate_panorama(scene, atlas, camera(), rgb, charts_seen=first.chart)
    texels = atlas.layout.texel_slice(scene.placement, hidden)
    shape = (scene.placement.height[hidden], scene.placement.width[hidden])
    written = (atlas.provenance[texels] == Provenance.TRANSLATED).reshape(shape)
    assert (atlas.colour[texels][written.reshape(-1)] == [0, 255, 0]).all()
    # seen from 2.5 m at y = -8, the roof line of the front (12 m at y = 0) hides the wall at y = 14 below 28.6 m
    heights = 30 - (np.arange(shape[0]) + 0.5) / 10
    assert not written[heights < 2.5 + 9.5 * 22 / 8 - 0.5].any()
    assert written[heights > 2.5 + 9.5 * 22 / 8 + 0.5].any()


def test_stronger_evidence_is_never_overwritten(scene: Scene) -> None:
    wall = south_wall(scene, 0)
    rasters, _ = TexelBuffer.plan_layout(scene.placement, [wall], range(len(scene.charts)))
    seed = np.full((rasters.total, 3), 77, np.uint8)
    evidence = np.zeros(rasters.total, np.uint8)
    texels = rasters.texel_slice(scene.placement, wall)
    evidence[texels.start : texels.start + 500] = Provenance.PHOTO
    atlas = window(scene, [wall], seed, evidence)
    propagate_panorama(scene, atlas, camera(), np.full((128, 256, 3), 200, np.uint8))
    assert (atlas.colour[texels][:500] == 77).all()
    assert (atlas.provenance[texels][:500] == Provenance.PHOTO).all()
    assert set(atlas.provenance[texels][500:]) <= {Provenance.TRANSLATED, Provenance.UNSEEN}
    assert (atlas.provenance[texels] == Provenance.TRANSLATED).any()


def test_views_beyond_the_range_do_not_count(scene: Scene) -> None:
    atlas = window(scene, np.flatnonzero(scene.charts.kind == ChartKind.WALL))
    far = Viewpoint(0, 0, np.array([10.0, -60.0, 2.5]), np.array([1.0, 0.0]))
    propagate_panorama(scene, atlas, far, np.full((64, 128, 3), 200, np.uint8))
    assert (atlas.provenance == Provenance.UNSEEN).all()


def test_swatches_keep_textured_pixels_and_paint_all_others(scene: Scene) -> None:
    swatches = MaterialFieldTranslator(scene, MaterialField(scene, [STREET], seed=1))
    panorama = render_panorama(scene, window(scene, []), camera(), (64, 128))
    panorama.textured[40:50] = True
    kept = panorama.rgb[40:50].copy()
    out = swatches.translate(panorama)
    np.testing.assert_array_equal(out[40:50], kept)
    bare = (panorama.chart >= 0) & ~panorama.textured
    assert (out[bare] != panorama.rgb[bare]).any(axis=1).mean() > 0.9


def test_what_was_seen_only_from_afar_is_bare_from_near(scene: Scene) -> None:
    """A stand-in is no texture to a viewpoint whose own view is proper; to others it is."""
    ground = np.flatnonzero(scene.charts.kind == ChartKind.GROUND)
    atlas = window(scene, ground)
    first = camera(-8.0)
    propagate_panorama(scene, atlas, first, np.full((128, 256, 3), 90, np.uint8))
    near, far = (render_panorama(scene, atlas, camera(x), (128, 256)) for x in (12.0, -7.0))
    on_ground = np.isin(near.chart, ground)
    along, behind = near.points[..., 0] - 12.0, np.abs(near.points[..., 0] + 8.0)
    close, beyond = on_ground & (np.abs(along) < 7.4), on_ground & (np.abs(along) > 7.6)
    assert close.sum() > 5000
    assert not near.textured[close & (behind > 8.0)].any()
    assert near.textured[beyond & (np.abs(near.points[..., 1] + 8) < 6) & (near.depth < 15)].mean() > 0.9
    assert (
        far.textured[np.isin(far.chart, ground) & (far.depth < 8)].mean() > 0.9
    )  # the first one's views are proper there


def test_only_equirectangular_shapes(scene: Scene) -> None:
    with pytest.raises(GeometryError, match="twice as wide"):
        render_panorama(scene, window(scene, []), camera(), (100, 100))


def test_only_tiles_under_pixels_are_visited(scene: Scene, monkeypatch) -> None:
    """Marked tiles give what all tiles give, but for slivers of pieces that no pixel beside theirs shows."""
    module = importlib.import_module("facade_core.street.propagation.propagate")
    rgb = np.random.default_rng(0).integers(0, 256, (128, 256, 3), dtype=np.uint8)
    marked, everywhere = (window(scene, range(len(scene.charts))) for _ in range(2))
    visited = []

    def mark(*arguments):
        tiles = mark_visible_texel_tiles(*arguments)
        visited.append(tiles.mean())
        return tiles

    with monkeypatch.context() as patched:
        patched.setattr(module, "mark_visible_texel_tiles", mark)
        propagate_panorama(scene, marked, camera(), rgb)
        patched.setattr(
            module, "mark_visible_texel_tiles", lambda *arguments: np.ones_like(mark_visible_texel_tiles(*arguments))
        )
        propagate_panorama(scene, everywhere, camera(), rgb)
    assert visited[0] < 0.8
    found, all_found = marked.provenance > Provenance.UNSEEN, everywhere.provenance > Provenance.UNSEEN
    assert not (found & ~all_found).any()
    assert (all_found & ~found).sum() < 2e-3 * all_found.sum()
    np.testing.assert_array_equal(marked.colour[found], everywhere.colour[found])


def test_pixels_average_the_texels_under_them(scene: Scene) -> None:
    """Stripes finer than a pixel become their mean, not one of them."""
    wall = south_wall(scene, 0)
    rasters, _ = TexelBuffer.plan_layout(scene.placement, [], range(len(scene.charts)))
    seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.full(rasters.total, Provenance.PHOTO, np.uint8)
    texels = rasters.texel_slice(scene.placement, wall)
    width, height = int(scene.placement.width[wall]), int(scene.placement.height[wall])
    seed[texels] = np.tile(
        np.where(np.arange(width) % 2, 200, 0).astype(np.uint8)[None, :, None], (height, 1, 3)
    ).reshape(-1, 3)
    panorama = render_panorama(scene, window(scene, [], seed, evidence), camera(), (32, 64))
    on_wall = panorama.chart == wall
    assert panorama.textured[on_wall].all()
    assert np.abs(panorama.rgb[on_wall].astype(int) - 100).max() <= 30


def test_a_window_for_a_shorter_range_is_refused(scene: Scene) -> None:
    far = replace(scene, visibility_range=150.0)
    with pytest.raises(GeometryError, match="visibility_range"):
        propagate_panorama(far, window(scene, range(len(scene.charts))), camera(), np.zeros((64, 128, 3), np.uint8))


def test_corners_and_courts_are_darker_than_open_ground(scene: Scene) -> None:
    light = ChartDaylight(scene.charts, scene.caster)
    hidden, roof = (
        south_wall(scene, 1),
        int(np.flatnonzero((scene.charts.building == 1) & (scene.charts.kind == ChartKind.ROOF))[0]),
    )
    light.compute([hidden, roof])

    def grid(chart: int) -> np.ndarray:
        start, shape = light.start[chart], (light.rows[chart], light.columns[chart])
        return light.light[start : start + shape[0] * shape[1]].reshape(shape)

    assert grid(roof).min() > 0.99  # the tallest of all
    wall = grid(hidden)
    assert wall[-1].mean() < wall[0].mean() - 0.15  # 4 m behind another house
    other = ChartDaylight(scene.charts, scene.caster)
    for chart in (hidden, int(np.flatnonzero(scene.charts.kind == ChartKind.GROUND)[0]), hidden):
        other.compute([chart])
    start = other.start[hidden]
    np.testing.assert_array_equal(other.light[start : start + wall.size], wall.ravel())
