"""Ground heights from a raster or from what the buildings stand on."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.types import Building, ElevationRaster
from facade_core.geometry.ground.terrain import build_terrain


def house(x: float, y: float, base: float | None) -> Building:
    return Building(f"{x}/{y}", shapely.box(x - 5, y - 5, x + 5, y + 5), 6.0, "height", base=base)


def test_without_any_height_the_ground_is_level_at_zero() -> None:
    terrain = build_terrain([house(0, 0, None)], None)
    assert terrain.is_level
    assert terrain.interpolate(np.array([[3.0, 4.0], [1e6, -1e6]])).tolist() == [0, 0]


def test_equal_bases_are_exactly_level() -> None:
    terrain = build_terrain([house(30 * i, 7 * i, 12.3) for i in range(9)], None)
    assert (terrain.interpolate(np.random.default_rng(0).random((50, 2)) * 300) == 12.3).all()


def test_a_raster_is_bilinear_north_up_and_constant_outside() -> None:
    heights = np.array([[10, 12, 14], [0, 2, 4]], np.float32)
    terrain = build_terrain([house(0, 0, 99.0)], ElevationRaster(100.0, 200.0, 5.0, heights))
    points = np.array([[100, 200], [102.5, 200], [100, 195], [105, 197.5], [0, 500], [500, 0]], np.float64)
    np.testing.assert_allclose(terrain.interpolate(points), [10, 11, 0, 7, 10, 4])


def test_gaps_in_a_raster_take_the_nearest_height() -> None:
    heights = np.full((5, 5), 3.0, np.float32)
    heights[:, 3:] = 8.0
    heights[2, 2], heights[2, 4] = np.nan, np.nan
    terrain = build_terrain([], ElevationRaster(0.0, 4.0, 1.0, heights))
    at = terrain.interpolate(np.array([[2.0, 2.0], [4.0, 2.0]]))
    assert at[0] in (3.0, 8.0)
    assert at[1] == 8.0
    assert (
        build_terrain([house(0, 0, 5.0)], ElevationRaster(0.0, 0.0, 1.0, np.full((2, 2), np.nan))).interpolate(
            np.zeros((1, 2))
        )
        == 5
    )


def test_bases_on_a_slope_make_a_slope_and_one_wild_base_does_not_matter() -> None:
    slope = [house(x, y, 0.05 * x) for x in range(0, 200, 20) for y in range(0, 200, 20)]
    points = np.random.default_rng(1).uniform(10, 170, (100, 2))
    clean = build_terrain(slope, None).interpolate(points)
    assert np.abs(clean - 0.05 * points[:, 0]).max() < 0.5
    slope[44] = house(80, 80, 500.0)
    wild = build_terrain(slope, None).interpolate(points)
    assert np.abs(wild - clean).max() < 1.0


def test_the_lowest_ground_along_an_outline() -> None:
    heights = np.add.outer(np.zeros(9), np.arange(9.0)).astype(np.float32)
    terrain = build_terrain([], ElevationRaster(0.0, 8.0, 1.0, heights))
    assert terrain.lowest_along(shapely.box(2.5, 1, 6, 5)) == pytest.approx(2.5)
