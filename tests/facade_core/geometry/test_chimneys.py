"""Chimneys stand on assumed roofs alone, few of them, wholly inside, always the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from facade_core.core.types import Building, Roof
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.ground.terrain import build_terrain

OUTLINE = shapely.box(0, 0, 40, 12)
HOUSE = Building("w1", OUTLINE, 9.0, "levels", roof=Roof("gabled", 3.0, pitch=26.0, confidence=0.5))


def tops(*buildings: Building) -> np.ndarray:
    """What stands out over 12 m, the ridge, (k, 3)."""
    mesh = build_block_surfaces(buildings, [], terrain=build_terrain([], None), ground_margin=20, largest=100)[1]
    return mesh.vertices[mesh.vertices[:, 2] > 12.01]


def test_some_houses_have_one_and_it_stands_inside() -> None:
    found = {id: tops(replace(HOUSE, id=id)) for id in map(str, range(12))}
    with_one = [points for points in found.values() if len(points)]
    assert 0 < len(with_one) < 12
    for points in with_one:
        assert shapely.contains_xy(OUTLINE.buffer(-0.5), points[:, 0], points[:, 1]).all()
        assert points[:, 2].max() < 13.5
        # four walls and a lid
        assert len(points) == 4 * 2 + 4
    assert len({tuple(points[0]) for points in with_one}) == len(with_one), "each elsewhere"
    id, points = next((id, points) for id, points in found.items() if len(points))
    np.testing.assert_array_equal(tops(replace(HOUSE, id=id)), points)


def test_none_on_a_stated_roof() -> None:
    stated = Roof("gabled", 3.0, pitch=26.0)
    assert not any(len(tops(replace(HOUSE, id=id, roof=stated))) for id in map(str, range(12)))
