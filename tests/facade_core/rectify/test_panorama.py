"""Rectification of painted walls, rendered into panoramas by the inverse formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import GeometryError, ImageError
from facade_core.core.types import Pose
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.scene import Scene
from facade_core.imagery.rectify.fusion import fuse_views
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama

DENSITY = 10.0
# left end, right end (as seen from outside), bottom and top in metres
WALL = ((100.0, 200.0), (110.0, 200.0), 0.0, 8.0)
OCCLUDER = ((103.0, 195.0), (105.0, 195.0), 0.0, 20.0)


def seen_from(*arguments) -> tuple[np.ndarray, np.ndarray]:
    """A wall's raster and what of it is seen."""
    view = rectify_chart_from_panorama(*arguments)
    return view.rgb, view.seen


def scene_of(*walls) -> Scene:
    """A scene of rectangles, one chart each."""
    origin, along, size, vertices = [], [], [], []
    for left, right, bottom, top in walls:
        edge = np.subtract(right, left)
        length = np.hypot(*edge)
        origin.append([*left, top])
        along.append([*edge / length, 0.0])
        size.append([length, top - bottom])
        vertices += [[*left, top], [*left, bottom], [*right, bottom], [*right, top]]
    n = len(walls)
    each = np.arange(n, dtype=np.int32)
    charts = Charts(
        np.zeros(n, np.uint8),
        each,
        each,
        np.array(origin),
        np.array(along),
        np.tile([0.0, 0, -1], (n, 1)),
        np.array(size),
    )
    triangles = (np.array([[0, 1, 2], [0, 2, 3]]) + 4 * each[:, None, None]).reshape(-1, 3).astype(np.int32)
    mesh = Mesh(np.array(vertices), triangles, np.repeat(each, 2), np.repeat(each, 4))
    placement = pack_charts(charts.size, DENSITY, each, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024))


def paint(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A wall's colour (..., 3) at metres right and down of its corner: smooth in two channels, squares of 2 m in the third."""
    squares = 40.0 + 170.0 * ((np.floor(x / 2) + np.floor(y / 2)) % 2)
    return np.stack([128 + 90 * np.sin(1.7 * x + 0.3), 128 + 90 * np.cos(1.3 * y + 0.2 * x), squares], axis=-1)


def photograph(pose: Pose, *, width: int = 2048) -> np.ndarray:
    """The panorama of WALL before a noisy world, written down from the definition of the angles, apart from the package."""
    u, v = (np.arange(width) + 0.5) / width, (np.arange(width // 2) + 0.5) / (width // 2)
    left, top, w, h = pose.view
    lon, lat = np.meshgrid(
        (u[(u >= left) & (u < left + w)] - 0.5) * 2 * np.pi, (0.5 - v[(v >= top) & (v < top + h)]) * np.pi
    )
    local = np.stack([np.cos(lat) * np.sin(lon), np.cos(lat) * np.cos(lon), np.sin(lat)], axis=-1)  # right, ahead, up
    turn = Rotation.from_euler("ZXY", [-pose.heading, pose.pitch, pose.roll], degrees=True)
    ray = turn.apply(local.reshape(-1, 3)).reshape(local.shape)
    (x0, y0), (x1, _), bottom, high = WALL
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (y0 - pose.y) / ray[..., 1]
        x, z = pose.x + t * ray[..., 0], pose.z + t * ray[..., 2]
    on = (t > 0) & (x >= x0) & (x <= x1) & (z >= bottom) & (z <= high)
    image = np.random.default_rng(0).uniform(60, 120, (*lon.shape, 3))
    image[on] = paint(x[on] - x0, high - z[on])
    return np.round(image).astype(np.uint8)


def truth(size: tuple[int, int] = (80, 100)) -> np.ndarray:
    """The mean of the paint over each texel."""
    fine = [(np.arange(8 * n) + 0.5) * (full / (8 * n)) for n, full in zip(size, (8.0, 10.0), strict=True)]
    x, y = np.meshgrid(fine[1], fine[0])
    return paint(x, y).reshape(size[0], 8, size[1], 8, 3).mean(axis=(1, 3))


@pytest.mark.parametrize(
    "pose",
    [
        Pose(104.0, 190.0, 2.5, 0.0),
        Pose(104.0, 190.0, 2.5, 180.0),  # the wall lies across the picture's border
        Pose(108.0, 192.0, 1.5, 37.0, pitch=6.0, roll=-4.0),
        Pose(96.0, 191.0, 4.0, 290.0, pitch=-11.0, roll=9.0),
        Pose(104.0, 190.0, 2.5, 10.0, view=(0.25, 0.25, 0.5, 0.375)),
        Pose(103.0, 196.5, 2.5, 140.0, pitch=2.0),  # close: a texel covers many pixels
    ],
)
def test_smooth_paint_is_recovered_within_two_grey_levels(pose: Pose) -> None:
    rgb, seen = seen_from(scene_of(WALL), 0, photograph(pose), pose, (80, 100))
    off = np.abs(rgb.astype(float) - truth())
    inner = seen.copy()
    inner[[0, 1, -2, -1]] = inner[:, [0, 1, -2, -1]] = False  # the wall's edge mixes with the world behind
    assert inner.mean() > 0.8
    assert off[inner][:, :2].max() < 2.0
    assert (off[inner][:, 2] > 30).mean() < 0.05  # squares: only texels on an edge may differ


def test_texels_are_where_the_wall_is() -> None:
    """Edges of the squares to a tenth of a texel."""
    pose = Pose(104.0, 190.0, 2.5, 25.0, pitch=3.0, roll=2.0, view=(0.3125, 0.3125, 0.3125, 0.25))
    rgb, _ = seen_from(scene_of(WALL), 0, photograph(pose, width=8192), pose, (80, 100))
    for axis, profile in ((1, rgb[4:16, :, 2]), (0, rgb[:, 4:16, 2].T)):
        share = (profile[:, 15:25].astype(float) - 40) / 170  # across the edge at 2 m
        rising = share.mean(axis=0) if share[:, -1].mean() > share[:, 0].mean() else 1 - share.mean(axis=0)
        edge = 25 - rising.sum()
        assert edge == pytest.approx(20.0, abs=0.1), f"axis {axis}"


def test_a_size_that_divides_the_chart_finer() -> None:
    pose = Pose(104.0, 190.0, 2.5, 0.0)
    rgb, seen = seen_from(scene_of(WALL), 0, photograph(pose, width=4096), pose, (160, 200))
    off = np.abs(rgb.astype(float) - truth((160, 200)))[4:-4, 4:-4, :2]
    assert seen.all()
    assert off.max() < 2.5


def test_what_another_building_hides_is_not_seen() -> None:
    pose = Pose(104.0, 190.0, 2.5, 0.0)
    _, seen = seen_from(scene_of(WALL, OCCLUDER), 0, photograph(pose), pose, (80, 100))
    # the occluder stands half-way: it hides twice its width, from 2 m to 6 m
    assert not seen[:, 21:59].any()
    assert seen[:, :19].all()
    assert seen[:, 61:].all()


def test_coplanar_pieces_and_thin_mouldings_do_not_hide() -> None:
    moulding = ((100.0, 199.97), (110.0, 199.97), 3.0, 4.0)
    pose = Pose(104.0, 190.0, 2.5, 0.0)
    assert seen_from(scene_of(WALL, moulding), 0, photograph(pose), pose, (80, 100))[1].all()


def test_the_flat_mask_at_the_bottom_is_not_seen() -> None:
    pose = Pose(104.0, 198.0, 2.5, 0.0)
    image = photograph(pose)
    image[np.arange(1024)[:, None] >= 720 + 40 * (np.arange(2048) // 64 % 2)] = 2  # an uneven border
    rgb, seen = seen_from(scene_of(WALL), 0, image, pose, (80, 100))
    _, unmasked = seen_from(scene_of(WALL), 0, photograph(pose), pose, (80, 100))
    assert unmasked[79, 40]
    assert not seen[79, 40]
    assert seen[60, 40]
    assert rgb[seen].min() > 20


def test_nothing_is_seen_from_behind_or_at_a_grazing_angle() -> None:
    scene = scene_of(WALL)
    for pose in (Pose(104.0, 210.0, 2.5, 0.0), Pose(60.0, 197.0, 2.5, 0.0)):
        rgb, seen = seen_from(scene, 0, photograph(pose), pose, (80, 100))
        assert not seen.any()
        assert not rgb.any()
        assert find_sightings(scene, 0, [pose], [(1024, 2048)]) == []


def test_a_picture_that_holds_a_part_shows_a_part() -> None:
    pose = Pose(105.0, 190.0, 4.0, 0.0, view=(0.0, 0.0, 0.5, 1.0))  # west of the wall's middle
    _, seen = seen_from(scene_of(WALL), 0, photograph(pose), pose, (80, 100))
    assert seen[:, :50].all()
    assert not seen[:, 50:].any()


def test_sightings_rank_frontal_near_pictures_first() -> None:
    scene = scene_of(WALL, OCCLUDER)
    poses = [
        Pose(105.0, 150.0, 2.5, 0.0),  # far
        Pose(108.0, 193.0, 2.5, 0.0),  # near and frontal
        Pose(104.0, 196.0, 2.5, 0.0),  # past the occluder, too near for the wall's ends
        Pose(105.0, 30.0, 2.5, 0.0),  # out of reach
    ]
    found = find_sightings(scene, 0, poses, [(1024, 2048)] * 4)
    assert found[0].panorama == 1
    assert {s.panorama for s in found} == {0, 1, 2}
    best = found[0]
    assert best.seen_share > 0.85
    assert best.pixels_per_metre == pytest.approx(2048 / (2 * np.pi) / 9, rel=0.2)
    shares = {s.panorama: s.seen_share for s in found}
    assert shares[2] > 0.9
    assert shares[0] == pytest.approx(0.775, abs=0.06)


def test_a_pose_without_height_and_a_grey_image_are_refused() -> None:
    scene, pose = scene_of(WALL), Pose(104.0, 190.0, None, 0.0)
    with pytest.raises(GeometryError, match="no height"):
        find_sightings(scene, 0, [pose], [(1024, 2048)])
    with pytest.raises(ImageError, match="uint8 RGB"):
        seen_from(scene, 0, np.zeros((4, 8)), Pose(104.0, 190.0, 2.0, 0.0), (80, 100))


def test_fusing_fills_what_the_best_does_not_see_and_levels_the_exposure() -> None:
    scene = scene_of(WALL, OCCLUDER)
    best, next_best = Pose(104.0, 190.0, 2.5, 0.0), Pose(110.0, 194.0, 2.5, 300.0)
    dark = np.round(photograph(next_best) * [0.7, 0.8, 0.75]).astype(np.uint8)
    views = [(photograph(best), best), (dark, next_best)]
    first, second = (rectify_chart_from_panorama(scene, 0, *view, (80, 100)) for view in views)
    fused = fuse_views([first, second])
    assert (fused.seen == (first.seen | second.seen)).all()
    filled = fused.seen & ~first.seen
    assert filled[:, 30:50].all()
    bright = (truth()[..., :2] > 60) & fused.seen[..., None]
    bright[[0, 1, -2, -1]] = False
    for channel in range(2):  # one exposure all over, whichever view it is of
        shown = bright[..., channel]
        ratio = fused.rgb[..., channel][shown] / truth()[..., channel][shown]
        assert ratio.std() < 0.04 * ratio.mean()
    assert (fused.source == 0).any()
    assert (fused.source[filled] == 1).all()


def test_fusing_without_overlap_keeps_colours() -> None:
    whole = Pose(105.0, 190.0, 4.0, 0.0)
    image = np.full((1024, 2048, 3), 77, np.uint8)
    image[::2] += 1  # no flat mask
    west, east = replace(whole, view=(0.0, 0.0, 0.5, 1.0)), replace(whole, view=(0.5, 0.0, 0.5, 1.0))
    views = [(image[:, :1024], west), (image[:, 1024:] + 40, east)]
    fused = fuse_views([rectify_chart_from_panorama(scene_of(WALL), 0, *view, (80, 100)) for view in views])
    assert fused.seen.all()
    assert (fused.rgb[:, 70] >= 116).all()
    assert (fused.rgb[:, 20] <= 78).all()


def test_what_a_panorama_hides_is_occluded_on_the_wall() -> None:
    scene, pose = scene_of(WALL), Pose(105.0, 190.0, 2.5, 0.0)
    image = photograph(pose)
    plain = rectify_chart_from_panorama(scene, 0, image, pose, (80, 100))
    assert plain.occluded is None
    hidden = np.zeros(image.shape[:2], bool)
    hidden[480:540, 980:1060] = True  # straight ahead, about the horizon
    view = rectify_chart_from_panorama(scene, 0, image, pose, (80, 100), hidden)
    assert (view.rgb == plain.rgb).all()
    assert (view.seen == plain.seen).all()
    assert view.occluded is not None
    rows, columns = np.nonzero(view.occluded)
    assert 45 < columns.mean() < 55
    assert 0.8 < rows.mean() / 55 < 1.2, "2.5 m over the foot of a wall of 8 m"
    width = columns.max() - columns.min() + 1
    assert abs(width - 2 - 10 * DENSITY * 80 * 2 * np.pi / 2048) < 4, "as wide as it looks from 10 m away, and a rim"
    again = rectify_chart_from_panorama(scene, 0, image, pose, (80, 100), np.zeros_like(hidden))
    assert again.occluded is not None
    assert not again.occluded.any()
