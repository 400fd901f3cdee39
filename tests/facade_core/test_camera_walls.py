"""Walls and roofs from panoramas: what is believed, what lies beside edges, and a painted side wall got back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
import shapely

from benchmarks.painter.street_paint import side_pattern_painter
from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.provenance import Provenance
from facade_core.core.types import Pose, Street
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.walls import main_surface_mask
from facade_core.imagery.cameras.camera_view import FusedCameraView, PanoramaCamera
from facade_core.imagery.cameras.occluder_masks import mask_model_edges
from facade_core.imagery.cameras.walls import chart_coverage_mask, fuse_wall_view, select_trusted_wall_texels
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart

SIZE = (40, 60)


def view(left: float, right: float, *, seen: bool = True) -> ChartView:
    rgb = np.full((*SIZE, 3), left)
    rgb[:, SIZE[1] // 2 :] = right
    there = np.ones(SIZE, bool)
    there[:, SIZE[1] // 2 :] = seen
    return ChartView(rgb.astype(np.uint8), there, np.full(SIZE, 0.5, np.float32))


def test_what_two_cameras_show_differently_is_not_believed_and_what_one_alone_shows_is() -> None:
    low = [np.indices(SIZE)[0] >= 30] * 2
    one, other = select_trusted_wall_texels([view(100, 100), view(104, 30)], low, 10.0)
    # a square beside the edge of the thing is still within what a pose may be off
    assert one[:, :30].all()
    assert not one[:, 36:].any()
    assert not other[:, 36:].any()
    alone, less = select_trusted_wall_texels([view(100, 60), view(102, 60, seen=False)], low, 10.0)
    assert alone[:30].all()
    assert alone[:, :30].all()
    assert not alone[30:, 36:].any(), "a bicycle, maybe"
    np.testing.assert_array_equal(less, view(0, 0, seen=False).seen)


@dataclass(frozen=True)
class Seen:
    """A side wall at the end of a street, and two cameras beyond it."""

    street: SyntheticStreet
    chart: int
    cameras: list[PanoramaCamera]


@pytest.fixture(scope="module")
def end() -> Seen:
    street = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0, with_roofs=True)
    charts = street.scene.charts
    outward = charts.normals()[:, :2] @ street.axis < -0.99
    chart = int(
        np.flatnonzero(outward & (charts.kind == ChartKind.WALL) & main_surface_mask(charts) & (charts.building == 0))[
            0
        ]
    )
    cameras = []
    for along, across in ((-6.0, 2.0), (-9.0, -3.0)):
        x, y = street.world_point(along, across)
        pose = Pose(float(x), float(y), 2.5, 40.0)
        image = render_street_panorama(street, pose, 1024, seed=1, sides=side_pattern_painter(street))
        hidden = mask_model_edges(street.scene, pose, image.shape[:2])
        cameras.append(PanoramaCamera(image, pose, hidden, np.ones(3), None))
    return Seen(street, chart, cameras)


def truth(seen: Seen) -> np.ndarray:
    """Of the wall's raster, (h, w, 3)."""
    scene, chart = seen.street.scene, seen.chart
    size = scene.placement.shape(chart)
    x, y = np.meshgrid((np.arange(size[1]) + 0.5) / 8, (np.arange(size[0]) + 0.5) / 8)
    return side_pattern_painter(seen.street)(np.full(x.size, chart), x.ravel(), y.ravel()).reshape(*size, 3)


def test_a_painted_side_wall_is_got_back_but_for_its_rim(end: Seen) -> None:
    found = fuse_wall_view(end.street.scene, end.chart, end.cameras)
    assert found is not None
    assert found.is_visible.mean() > 0.6
    assert not found.is_visible[[0, -1]].any()
    assert not found.is_visible[:, [0, -1]].any()
    assert set(np.unique(found.camera[found.is_visible])) <= {0, 1}
    wall = truth(end)
    # bricks are finer than the texels: what they look like from afar
    seen, true = (
        cv2.blur(np.where(found.is_visible[..., None], one, 0).astype(np.float32), (9, 9))[found.is_visible].mean(
            axis=1
        )
        for one in (found.rgb, wall)
    )
    assert np.corrcoef(seen, true)[0, 1] > 0.9
    far = replace(end.cameras[0], pose=replace(end.cameras[0].pose, x=end.cameras[0].pose.x - 60))
    assert fuse_wall_view(end.street.scene, end.chart, [far]) is None


def test_beside_a_gable_is_no_wall(end: Seen) -> None:
    scene = end.street.scene
    walls = np.flatnonzero((scene.charts.kind == ChartKind.WALL) & main_surface_mask(scene.charts))
    shares = [chart_coverage_mask(scene, wall).mean() for wall in walls.tolist()]
    own = chart_coverage_mask(scene, int(walls[np.argmin(shares)]))
    assert 0.45 < own.mean() < 0.6
    assert own[-1, own.shape[1] // 2]
    assert not own[0, [0, -1]].any()
    assert np.max(shares) == 1


def test_pictures_of_a_wall_go_on_where_none_shows_it(end: Seen) -> None:
    """A hole in the middle; without pictures the wall is as it was."""
    scene, chart = end.street.scene, end.chart
    wall = truth(end).astype(np.uint8)
    size = wall.shape[:2]
    shown = np.ones(size, bool)
    shown[10:40, 20:50] = False
    given = FusedCameraView(wall, shown, np.where(shown, 0, -1).astype(np.int8), shown.astype(np.float32))

    def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        if one == chart:
            rank = np.where(given.is_visible, Provenance.PHOTO, Provenance.UNSEEN).astype(np.uint8)
            return given.rgb[rows, columns], rank[rows, columns]
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        return np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)

    street = Street(
        "s", None, shapely.LineString([end.street.world_point(0, 0), end.street.world_point(end.street.length, 0)])
    )
    materials = MaterialField(scene, (street,), seed=1)
    colour, rank = finish_chart(scene, materials, chart, KnownTexture(read, {chart}, {chart}))
    assert (rank[~shown] == Provenance.INPAINTED).all()
    np.testing.assert_array_equal(colour[shown], wall[shown])
    levelled, before = finish_chart(scene, materials, chart, KnownTexture(read, {chart}))
    assert (before[~shown] < Provenance.INPAINTED).all()
    off, plain = (np.abs(one[~shown].mean(axis=0) - wall[~shown].mean(axis=0)).mean() for one in (colour, levelled))
    assert off < plain
