"""Completion problems with a known answer, from whole layouts with a part hidden; for training and benchmarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle

# Kinds of the benchmark; training also uses the others.
BENCHMARK_KINDS = ("right", "lower", "region", "sparse")
CASE_KINDS = (*BENCHMARK_KINDS, "left", "upper")


def hide_part(
    kind: str, elements: Sequence[Element], domain: Rectangle, rng: np.random.Generator
) -> tuple[list[Element], list[Rectangle]]:
    """Hide a part of a layout and return the visible elements and the visible region.

    Half of the facade is hidden, a random rectangle of 30-50 %, or all but 25-35 % of the elements. An element that
    intersects the visible region is visible.

    Parameters
    ----------
    kind : one of CASE_KINDS.
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
    else:
        count = max(1, round(rng.uniform(0.25, 0.35) * len(elements)))
        seen = [elements[i] for i in np.sort(rng.permutation(len(elements))[:count])]
        return seen, [(e.x0, e.y0, e.x1, e.y1) for e in seen]
    return [e for e in elements if any(_intersects(e, r) for r in region)], region


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
