"""Which pictured facade gives its style to the walls of its building without a picture."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.provenance import Provenance
from facade_core.geometry.chart_packing import ChartPlacements
from tasks.stages.facades.pictured_style import select_pictured_style

DENSITY = 20.0


class Pages(np.ndarray):
    """Pages of the atlas in memory, in one chunk."""

    @property
    def chunks(self) -> tuple[int, ...]:
        return (1, self.shape[1], self.shape[2])


@pytest.fixture
def block() -> tuple[Any, Any]:
    """Two facades of one look beside each other on a page: the second is wider and less of it is pictured."""
    painted = paint_facade((10.0, 8.0), floors=3, columns=3, style="haussmann", metres_per_pixel=1 / DENSITY, seed=1)
    height, width = painted.labels.shape
    wide = 2 * width
    page = {
        "atlas/seed": np.zeros((1, height, width + wide, 3), np.uint8),
        "facade_maps/labels": np.zeros((1, height, width + wide), np.uint8),
        "atlas/seed_evidence": np.full((1, height, width + wide), Provenance.PHOTO, np.uint8),
    }
    for left in (0, width, 2 * width):
        page["atlas/seed"][0, :, left : left + width] = painted.image
        page["facade_maps/labels"][0, :, left : left + width] = painted.labels
    column = np.array([0, width], np.int32)
    size = np.array([width, wide], np.int32)
    tall = np.full(2, height, np.int32)
    none = np.zeros(2, np.int32)
    placement = ChartPlacements(none, column, none, size, tall, np.full(2, DENSITY), 1)
    charts = SimpleNamespace(size=np.column_stack([size, tall]) / DENSITY)
    plan = SimpleNamespace(
        facades=SimpleNamespace(chart=np.array([0, 1])), scene=SimpleNamespace(placement=placement, charts=charts)
    )
    return {name: array.view(Pages) for name, array in page.items()}, plan


def test_the_facade_of_which_most_is_pictured_is_taken(block: tuple[Any, Any]) -> None:
    group, plan = block
    style = select_pictured_style(group, plan, "picture of {}".format, (0, 1))
    assert style is not None
    assert (style.source, style.metres_per_pixel) == ("picture of 1", 1 / DENSITY)
    width = int(plan.scene.placement.width[0])
    group["atlas/seed_evidence"][0, :, width : 2 * width] = Provenance.INPAINTED
    style = select_pictured_style(group, plan, "picture of {}".format, (0, 1))
    assert style is not None
    assert style.source == "picture of 0", "half of the other is made up"
    assert style.style.labels.shape[1] == width


def test_what_shows_too_little_or_no_window_gives_no_style(block: tuple[Any, Any]) -> None:
    group, plan = block
    assert select_pictured_style(group, plan, str, ()) is None
    group["facade_maps/labels"][:] = 0
    assert select_pictured_style(group, plan, str, (0, 1)) is None


def test_a_hidden_foot_gives_no_style(block: tuple[Any, Any]) -> None:
    group, plan = block
    group["atlas/seed_evidence"][0, -30:] = Provenance.INPAINTED
    style = select_pictured_style(group, plan, str, (0, 1))
    assert style is not None
    assert len(style.style.labels) == plan.scene.placement.height[1] - 30
