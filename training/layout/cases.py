"""Completion problems with a known answer, from whole layouts with a part hidden; for training and benchmarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import BoolArray
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.visible_region import visible_region_boxes

# Kinds of the published figures; training also uses left and upper, the benchmark the others.
BENCHMARK_KINDS = ("right", "lower", "region", "sparse")
CASE_KINDS = (*BENCHMARK_KINDS, "left", "upper")
OTHER_KINDS = ("middle", "corner", "holes", "most", "trees")
# Cells of a raster that trees are drawn on, along a side.
_TREE_CELLS = 48


def hide_part(
    kind: str, elements: Sequence[Element], domain: Rectangle, rng: np.random.Generator
) -> tuple[list[Element], list[Rectangle]]:
    """Hide a part of a layout and return the visible elements and the visible region.

    Half of the facade is hidden, a random rectangle of 30-50 %, all but 25-35 % of the elements ("sparse"), a third to
    two thirds of its width ("middle"), a corner of 30-60 %, two to four rectangles ("holes"), all but a rectangle of 30 %
    ("most"), or one to three crowns with trunks ("trees"). An element that intersects the visible region is visible.

    Parameters
    ----------
    kind : one of CASE_KINDS or OTHER_KINDS.
    domain : (x0, y0, x1, y1) of the facade.
    """
    x0, y0, x1, y1 = domain
    if kind == "right":
        region = [(x0, y0, (x0 + x1) / 2, y1)]
    elif kind == "left":
        region = [((x0 + x1) / 2, y0, x1, y1)]
    elif kind == "lower":
        region = [(x0, y0, x1, (y0 + y1) / 2)]
    elif kind == "upper":
        region = [(x0, (y0 + y1) / 2, x1, y1)]
    elif kind == "region":
        share = rng.uniform(0.3, 0.5)
        w = rng.uniform(share, 1) ** 0.5
        h = share / w
        a, b = x0 + rng.uniform(0, 1 - w) * (x1 - x0), y0 + rng.uniform(0, 1 - h) * (y1 - y0)
        c, d = a + w * (x1 - x0), b + h * (y1 - y0)
        around = [(x0, y0, x1, b), (x0, d, x1, y1), (x0, b, a, d), (c, b, x1, d)]
        region = [r for r in around if r[0] < r[2] and r[1] < r[3]]
    elif kind in OTHER_KINDS:
        region = _hide_cells(kind, domain, rng)
    else:
        count = max(1, round(rng.uniform(0.25, 0.35) * len(elements)))
        seen = [elements[i] for i in np.sort(rng.permutation(len(elements))[:count])]
        return seen, [(e.x0, e.y0, e.x1, e.y1) for e in seen]
    return [e for e in elements if any(_intersects(e, r) for r in region)], region


def _hide_cells(kind: str, domain: Rectangle, rng: np.random.Generator) -> list[Rectangle]:
    """Return the visible boxes of a facade with one of OTHER_KINDS hidden, on a raster."""
    y, x = (np.mgrid[:_TREE_CELLS, :_TREE_CELLS] + 0.5) / _TREE_CELLS

    def inside(a: float, b: float, width: float, height: float) -> BoolArray:
        covered: BoolArray = (x >= a) & (x < a + width) & (y >= b) & (y < b + height)
        return covered

    hidden = np.zeros(x.shape, bool)
    if kind == "middle":
        width = rng.uniform(0.33, 0.67)
        hidden |= inside(rng.uniform(0.1, 0.9 - width), 0, width, 1)
    elif kind == "corner":
        share = rng.uniform(0.3, 0.6)
        width = rng.uniform(share, 1)
        height = share / width
        hidden |= inside(rng.integers(2) * (1 - width), rng.integers(2) * (1 - height), width, height)
    elif kind == "holes":
        for _ in range(rng.integers(2, 5)):
            width, height = rng.uniform(0.2, 0.5, 2).tolist()
            left, top = rng.uniform(0, (1 - width, 1 - height)).tolist()
            hidden |= inside(left, top, width, height)
    elif kind == "most":
        width = rng.uniform(0.35, 0.85)
        height = 0.3 / width
        left, top = rng.uniform(0, (1 - width, 1 - height)).tolist()
        hidden |= ~inside(left, top, width, height)
    else:
        for _ in range(rng.integers(1, 4)):
            at, top, radius, tall = rng.uniform((0, 0.2, 0.12, 0.15), (1, 0.8, 0.3, 0.4)).tolist()
            ragged = 1 + 0.15 * np.sin(5 * np.arctan2(y - top, x - at) + rng.uniform(0, 6))
            hidden |= np.hypot((x - at) / radius, (y - top) / tall) < ragged
            hidden |= (np.abs(x - at) < 0.025) & (y > top)
    scale = np.array([domain[2] - domain[0], domain[3] - domain[1]] * 2) / _TREE_CELLS
    boxes = np.array(visible_region_boxes(hidden), float).reshape(-1, 4) * scale + np.array(domain[:2] * 2)
    return [(a, b, c, d) for a, b, c, d in boxes.tolist()]


def mirror_layout(elements: Sequence[Element], domain: Rectangle) -> list[Element]:
    """Return the mirror image of a layout."""
    twice = domain[0] + domain[2]
    return [replace(e, x0=twice - e.x1, x1=twice - e.x0) for e in elements]


def sample_regular_layout(rng: np.random.Generator) -> tuple[list[Element], Rectangle]:
    """Sample a facade of equal windows at equal distances, and its domain, in window widths."""
    columns, floors = int(rng.integers(3, 24)), int(rng.integers(2, 16))
    height = np.exp(rng.normal(0.4, 0.2))
    pitch = rng.uniform(1.6, 3.0), height * rng.uniform(1.5, 2.6)
    margin = rng.uniform(0.2, 1.2), height * rng.uniform(0.2, 1.2)
    corners = [(margin[0] + c * pitch[0], margin[1] + f * pitch[1]) for f in range(floors) for c in range(columns)]
    domain = 2 * margin[0] + (columns - 1) * pitch[0] + 1, 2 * margin[1] + (floors - 1) * pitch[1] + height
    return [Element("window", x, y, x + 1, y + height) for x, y in corners], (0.0, 0.0, *domain)


def _intersects(e: Element, r: Rectangle) -> bool:
    return min(e.x1, r[2]) > max(e.x0, r[0]) and min(e.y1, r[3]) > max(e.y0, r[1])
