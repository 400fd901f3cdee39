"""A model's own textures on a chart."""

from __future__ import annotations

import numpy as np

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.scene import Scene
from facade_core.imagery.rectify.model_texture import render_model_texture

DENSITY = 10.0


def scene_of(uv: np.ndarray, texture: list[int]) -> Scene:
    """One wall of 8 x 4 m in two triangles: lower left and upper right of its diagonal from the top left."""
    charts = Charts(
        np.zeros(1, np.uint8),
        np.zeros(1, np.int32),
        np.zeros(1, np.int32),
        np.array([[5.0, 5.0, 4.0]]),
        np.array([[1.0, 0.0, 0.0]]),
        np.array([[0.0, 0.0, -1.0]]),
        np.array([[8.0, 4.0]]),
    )
    vertices = np.array([[5.0, 5, 4], [5, 5, 0], [13, 5, 0], [13, 5, 4]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    mesh = Mesh(
        vertices,
        triangles,
        np.zeros(2, np.int32),
        np.zeros(4, np.int32),
        texture=np.array(texture, np.int32),
        uv=uv[triangles].astype(np.float32),
    )
    placement = pack_charts(charts.size, DENSITY, np.zeros(1, int), page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024))


UPRIGHT = np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])


def ramp(rows: int, columns: int) -> np.ndarray:
    """Red grows to the right, green downwards: (rows, columns, 3) float64."""
    y, x = np.mgrid[:rows, :columns]
    return np.stack(
        [20 + 200 * (x + 0.5) / columns, 20 + 200 * (y + 0.5) / rows, np.full((rows, columns), 60.0)], axis=-1
    )


def picture(rows: int, columns: int) -> np.ndarray:
    return np.round(ramp(rows, columns)).astype(np.uint8)


def test_the_picture_stands_upright_on_the_wall() -> None:
    for scale in (1, 4, 16):  # texels of one, four and sixteen pixels
        rgb, covered = render_model_texture(scene_of(UPRIGHT, [0, 0]), 0, {0: picture(40 * scale, 80 * scale)})
        assert rgb.shape == (40, 80, 3)
        assert covered.all()
        assert np.abs(rgb - ramp(40, 80))[1:-1, 1:-1].max() < 2


def test_fine_stripes_become_their_mean() -> None:
    stripes = np.zeros((400, 800, 3), np.uint8)
    stripes[:, ::2] = 200
    rgb, _ = render_model_texture(scene_of(UPRIGHT, [0, 0]), 0, {0: stripes})
    assert np.abs(rgb.astype(int) - 100).max() <= 2


def test_coordinates_beyond_one_repeat() -> None:
    rgb, covered = render_model_texture(scene_of(UPRIGHT * (2, 1) - (3, 0), [0, 0]), 0, {0: picture(40, 40)})
    assert covered.all()
    assert np.abs(rgb[:, :40].astype(int) - rgb[:, 40:]).max() <= 1
    assert abs(int(rgb[20, 10, 0]) - (20 + 200 * 10.5 / 40)) <= 1


def test_only_textured_triangles_and_one_texel_around_are_covered() -> None:
    rgb, covered = render_model_texture(scene_of(UPRIGHT, [0, -1]), 0, {0: np.full((8, 8, 3), 99, np.uint8)})
    row, column = np.mgrid[:40, :80]
    below = (row + 0.5) / 40 - (column + 0.5) / 80  # over 0: below the diagonal
    assert covered[below > 0].all()
    assert not covered[below < -0.05].any()
    assert (rgb[covered] == 99).all()
    assert not rgb[~covered].any()
    assert covered[(below < 0) & (below > -0.01)].all()


def test_a_missing_picture_leaves_the_wall_uncovered() -> None:
    rgb, covered = render_model_texture(scene_of(UPRIGHT, [3, 3]), 0, {})
    assert not covered.any()
    assert not rgb.any()


def test_the_opposite_border_of_a_picture_does_not_bleed_in() -> None:
    halves = np.zeros((10, 20, 3), np.uint8)
    halves[:, :10] = 200
    rgb, _ = render_model_texture(scene_of(UPRIGHT, [0, 0]), 0, {0: halves})
    assert (rgb[:, 0] == 200).all()
    assert (rgb[:, -1] == 0).all()


def test_a_part_of_a_large_picture() -> None:
    whole = ramp(4000, 4000)
    rgb, covered = render_model_texture(scene_of(0.25 + UPRIGHT * (0.02, 0.01), [0, 0]), 0, {0: whole.astype(np.uint8)})
    assert covered.all()
    # rows from 0.26 down to 0.25 of the height, upwards
    assert np.abs(rgb[..., 1].astype(float) - (20 + 200 * 0.745)).max() < 3
    assert np.abs(rgb[..., 0].astype(float) - (20 + 200 * 0.26)).max() < 4
