"""Doubts about an elevation model that does not fit the buildings."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from catalogs.block.terrain_checks import note_terrain_doubts
from facade_core.core.types import Building, ElevationRaster


def houses(base: float | None = None) -> list[Building]:
    return [
        Building(str(i), shapely.box(30.0 * i, 10.0, 30.0 * i + 12.0, 22.0), 9.0, "height", base=base) for i in range(3)
    ]


def raster(height: float = 30.0, step: float = 1.0) -> ElevationRaster:
    size = int(200 / step)
    return ElevationRaster(-50.0, 100.0, step, np.full((size, size), height, np.float32))


def test_a_fitting_model_has_no_note() -> None:
    assert note_terrain_doubts(raster(), houses(), "t.tif") == ()
    assert note_terrain_doubts(raster(), houses(31.0), "t.tif") == ()


@pytest.mark.parametrize("base", [12.0, 48.0])
def test_another_datum_is_noted(base: float) -> None:
    (note,) = note_terrain_doubts(raster(), houses(base), "t.tif")
    assert "18.0 m " + ("above" if base < 30 else "below") in note


def test_roofs_in_the_model_are_noted() -> None:
    surface = raster()
    for number in range(3):
        surface.heights[78:91, 50 + 30 * number : 63 + 30 * number] += 9
    (note,) = note_terrain_doubts(surface, houses(), "dsm.tif")
    assert "dsm.tif shows 3 of 3 buildings 9.0 m above the ground around them" in note


def test_buildings_without_heights_are_counted() -> None:
    part = raster()
    part.heights[:, 100:] = np.nan
    (note,) = note_terrain_doubts(part, houses(), "t.tif")
    assert note.startswith("t.tif states no height at 1 building of 3")


def test_a_picture_is_noted() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (200, 200)).astype(np.float32)
    (note,) = note_terrain_doubts(ElevationRaster(-50.0, 100.0, 1.0, noise), houses(), "t.tif")
    assert "as a picture is" in note


@pytest.mark.parametrize(("height", "cells", "is_noted"), [(30.0, 10, True), (2.0, 10, False), (30.0, 1, False)])
def test_zeros_between_other_heights_are_noted(height: float, cells: int, is_noted: bool) -> None:
    holed = raster(height)
    holed.heights[:cells, :cells] = 0.0
    notes = note_terrain_doubts(holed, houses(), "t.tif")
    assert any("-a_nodata 0 t.tif" in note for note in notes) == is_noted
