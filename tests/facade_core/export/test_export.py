"""The model and the pictures say what the atlas says."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Building, Lattice, Street
from facade_core.export.models.pages import fill_between_charts
from facade_core.export.pictures.camera import PerspectiveCamera, aerial_camera
from facade_core.export.pictures.occlusion_overlay import draw_crop_preview, overlay_occlusion
from facade_core.export.pictures.rendering import (
    average_samples,
    cast_smooth_view,
    cast_view,
    draw_parse,
    render_perspective,
)
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import CORNER_SHARES, ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.sky import backdrop_colour, sky_colour

STREET = Street("s", None, shapely.LineString([(-10, -8), (30, -8)]))


@pytest.fixture(scope="module")
def scene() -> Scene:
    box = Building("a", shapely.box(0, 0, 20, 10), 12.0, "height")
    charts, mesh, _ = build_block_surfaces(
        [box], [STREET], terrain=build_terrain([], None), ground_margin=10, largest=90
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024))


def page_of_kinds(scene: Scene, page: int) -> np.ndarray:
    """A page with every chart in its own colour."""
    colour = np.zeros((1024, 1024, 3), np.uint8)
    placement = scene.placement
    for c in np.flatnonzero(placement.page == page):
        y, x = placement.y[c], placement.x[c]
        colour[y - 2 : y + placement.height[c] + 2, x - 2 : x + placement.width[c] + 2] = [c * 7 + 20, 120, 255 - 5 * c]
    return colour


def test_mipmaps_of_a_page_do_not_bleed(scene: Scene) -> None:
    """No level of a mipmap that touches a chart is darker than the chart's darkest: nothing between charts is black."""
    page = page_of_kinds(scene, 0)
    filled = fill_between_charts(scene, 0, page).astype(float)
    owned = np.zeros((1024, 1024), bool)
    for c in np.flatnonzero(scene.placement.page == 0):
        y, x = int(scene.placement.y[c]), int(scene.placement.x[c])
        owned[y : y + int(scene.placement.height[c]), x : x + int(scene.placement.width[c])] = True
    np.testing.assert_array_equal(filled[owned], page[owned])
    darkest = filled[owned].min(axis=0)
    for _ in range(7):
        filled = filled.reshape(len(filled) // 2, 2, -1, 2, 3).mean(axis=(1, 3))
        owned = owned.reshape(len(owned) // 2, 2, -1, 2).any(axis=(1, 3))
        assert (filled[owned] >= darkest - 1).all()


def test_the_picture_shows_walls_upright_and_sky_above(scene: Scene) -> None:
    picture = cast_view(
        scene, PerspectiveCamera(np.array([10.0, -30, 3]), np.array([10.0, 0, 3]), 60.0, (60, 80)), samples=1
    )
    picture.paint({chart: np.full((3, 5, 3), 9, np.uint8) for chart in picture.visible_charts.tolist()})
    assert (picture.rgb[30, 40] == 9).all()
    assert (picture.rgb[0] > 100).all()


def test_what_is_finer_than_pixels_is_seen_as_its_mean_and_what_is_coarser_without_steps(scene: Scene) -> None:
    """A chequered wall from far and aslant is grey; two colours from near go over into one another."""
    place = scene.placement

    def chequered(chart: int) -> np.ndarray:
        row, column = np.indices((place.height[chart], place.width[chart]))
        return np.repeat((255 * ((row + column) % 2)).astype(np.uint8)[..., None], 3, axis=2)

    for at in ([10.0, -400, 3], [-60.0, -6, 5]):
        camera = PerspectiveCamera(np.array(at), np.array([10.0, 0, 5]), 2.0, (60, 80))
        picture = cast_view(scene, camera, samples=1)
        walls = scene.charts.kind[picture.chart] == ChartKind.WALL
        picture.paint({chart: chequered(chart) for chart in picture.visible_charts.tolist()})
        shown = picture.rgb.reshape(-1, 3)[picture.pixel[walls]]
        assert walls.sum() > 500
        assert 120 < shown.mean() < 135
        assert shown.std() < 30, "by nearest texels it would be 127"
    near = PerspectiveCamera(np.array([10.0, -3.0, 3]), np.array([10.0, 0, 3]), 4.0, (60, 80))
    picture = cast_view(scene, near, samples=1)
    picture.paint({chart: chequered(chart) for chart in picture.visible_charts.tolist()})
    steps = np.abs(np.diff(picture.rgb[..., 0].astype(int), axis=1))
    assert 2 < steps.max() < 60


def test_a_smooth_view_is_as_one_of_many_rays_a_pixel(scene: Scene) -> None:
    """At edges to the bit; inside a chart the filter averages what the rays would."""
    place = scene.placement
    shades = {}
    for chart in range(len(scene.charts)):
        row = np.linspace(0, 200, place.width[chart]).astype(np.uint8)
        shades[chart] = np.tile(row[None, :, None], (place.height[chart], 1, 3))
    camera = PerspectiveCamera.from_heading(
        np.array([10.0, -30, 3]), heading=30, pitch=4, field_of_view=80, size=(90, 120)
    )
    many = cast_view(scene, camera, samples=2)
    smooth = cast_smooth_view(scene, camera, samples=2)
    assert set(smooth.visible_charts.tolist()) == set(many.visible_charts.tolist())
    assert 0 < len(smooth.edges) < 0.25 * 90 * 120
    for picture in (many, smooth):
        picture.paint(shades)
    expected, found = average_samples(many.apply_haze(), 2), smooth.finish()
    np.testing.assert_array_equal(found.reshape(-1, 3)[smooth.edges], expected.reshape(-1, 3)[smooth.edges])
    other = np.abs(found.astype(int) - expected).max(axis=-1) > 4
    assert other.mean() < 0.02, "where a texture is coarser than pixels, and at corners between two centres"


def test_haze_grows_with_distance_and_no_pixel_is_without_colour(scene: Scene) -> None:
    black = {c: np.zeros((2, 2, 3), np.uint8) for c in range(len(scene.charts))}
    aslant = PerspectiveCamera.from_heading(
        np.array([10.0, -30, 3]), heading=30, pitch=0, field_of_view=80, size=(20, 20)
    )
    picture = cast_view(scene, aslant, samples=1)
    hazed = picture.apply_haze().reshape(-1, 3)[picture.pixel]
    assert hazed[picture.depth.argmin()].max() == 0, "it begins at what is nearest"
    assert hazed[picture.depth.argmax()].min() > 0
    assert (np.diff(hazed[np.argsort(picture.depth), 0].astype(int)) >= 0).all()
    up = PerspectiveCamera.from_heading(
        np.array([10.0, -30, 3]), heading=180, pitch=40, field_of_view=80, size=(40, 40)
    )
    drawn = render_perspective(scene, up, black.__getitem__)
    assert drawn.min() > 90
    assert drawn[0, 20, 0] < drawn[39, 20, 0], "the sky is deeper above"


def test_streets_end_in_roofs_and_not_in_the_sky() -> None:
    turn = np.linspace(0, 2 * np.pi, 400, endpoint=False)

    def shown(steep: float) -> np.ndarray:
        rays = np.column_stack([np.sin(turn), np.cos(turn), np.full(len(turn), steep)])
        return backdrop_colour(rays / np.hypot(1, steep)) - sky_colour(np.full(len(turn), steep / np.hypot(1, steep)))

    assert (np.abs(shown(0.01)).max(axis=1) > 20).all(), "in all directions"
    assert not shown(0.1).any()
    rises = np.array([(np.abs(shown(steep)).max(axis=1) > 1).mean() for steep in (0.03, 0.05, 0.07)])
    assert (np.diff(rises) < 0).all(), "roofs of all heights"


def test_nothing_that_a_picture_shows_is_said_to_be_out_of_sight(scene: Scene) -> None:
    corners = scene.charts.points_at_shares(np.arange(len(scene.charts)), CORNER_SHARES)
    fewest = len(corners)
    for place in ([10.0, -30, 3], [25.0, 5, 6], [10.0, 5, 40], [-8.0, -8, 2]):
        for target in ([10.0, 0, 3], [30.0, 20, 3], [-20.0, -9, 1]):
            camera = PerspectiveCamera(np.array(place), np.array(target), 60.0, (60, 80))
            may = camera.may_show(corners)
            assert may[cast_view(scene, camera, samples=1).visible_charts].all()
            fewest = min(fewest, int(may.sum()))
    assert fewest < len(corners)


def test_the_aerial_camera_sees_the_whole_building(scene: Scene) -> None:
    camera = aerial_camera(scene, (90, 144))
    forward = (camera.target - camera.position) / np.linalg.norm(camera.target - camera.position)
    walls = scene.mesh.vertices[scene.charts.kind[scene.mesh.vertex_chart] == ChartKind.WALL]
    right = np.cross(forward, [0, 0, 1]) / np.linalg.norm(np.cross(forward, [0, 0, 1]))
    relative = walls - camera.position
    depth = relative @ forward
    half_width = np.tan(np.radians(camera.field_of_view) / 2)
    across = np.abs(relative @ right) / depth / half_width
    along = np.abs(relative @ np.cross(forward, right)) / depth / half_width / (90 / 144)
    assert max(across.max(), along.max()) < 1
    assert max(across.max(), along.max()) > 0.9  # and no farther away than it need be


def test_stage_pictures() -> None:
    labels = np.full((20, 30), FacadeClass.WINDOW, np.uint8)
    drawn = draw_parse(labels, Lattice((0, 10, 20), (0, 30)))
    assert (drawn[10] == 255).all()
    assert (drawn[5, 5] != 255).any()
    hidden = np.zeros((20, 30), bool)
    hidden[3, 4] = True
    image = np.full((20, 30, 3), 100, np.uint8)
    tinted = overlay_occlusion(image, hidden)
    assert tinted[3, 4, 0] > 100 > tinted[3, 4, 2]
    assert (tinted[~hidden] == 100).all()


def test_a_cut_is_drawn_with_what_is_left_out_dark_and_what_is_made_anew_tinted() -> None:
    image = np.full((200, 100, 3), 100, np.uint8)
    hidden = np.zeros((120, 60), bool)
    hidden[:20] = True
    drawn = draw_crop_preview(image, hidden, (20, 40, 80, 160))
    assert drawn.shape == image.shape
    assert (drawn[:40] == 25).all()
    assert (drawn[:, 80:] == 25).all()
    assert (drawn[60:160, 20:80] == 100).all()
    assert (drawn[40:60, 20:80, 0] > 100).all()
    large, unseen = np.zeros((1280, 700, 3), np.uint8), np.zeros((1280, 700), bool)
    assert draw_crop_preview(large, unseen, (0, 0, 700, 1280)).shape == (640, 350, 3)
