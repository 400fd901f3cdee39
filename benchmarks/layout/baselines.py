"""What completion is measured against: simpler ways to fill the hidden part."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.papers.completion import Method, element_rows, remove_rows_outside
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grid_extension import ExtensionVariant, extension_context, propose_extension_elements
from facade_core.facade.layout.grids import fit_grids
from facade_core.facade.layout.model import LayoutModel
from facade_core.facade.layout.rectangles import overlap_mask, pairwise_iou

_NOTHING = np.zeros((0, 5))


def median_pitch(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
    """Every grid carried on at its median spacing, in both directions, its gaps filled."""
    found = []
    for grid in fit_grids(seen):
        axes = []
        for positions, size, low, high in (
            (grid.columns, grid.width, domain[0], domain[2]),
            (grid.rows, grid.height, domain[1], domain[3]),
        ):
            lines = np.array(positions)
            if len(lines) > 1:
                pitch = float(np.median(np.diff(lines)))
                before = np.arange(lines[0] - pitch, low + size / 2, -pitch)
                lines = np.concatenate([before, lines, np.arange(lines[-1] + pitch, high - size / 2, pitch)])
            axes.append(lines)
        x, y = (a.ravel() for a in np.meshgrid(*axes))
        half = (grid.width / 2, grid.height / 2)
        label = np.full(len(x), ELEMENT_CLASSES.index(grid.label))
        found.append(np.column_stack([label, x - half[0], y - half[1], x + half[0], y + half[1]]))
    return [remove_rows_outside(np.concatenate(found), seen, domain, region)]


def extension(how: ExtensionVariant) -> Method:
    """Grids carried on with filled gaps, own sizes, patterns and balconies."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        return [
            remove_rows_outside(
                element_rows(list(propose_extension_elements(extension_context(seen, fit_grids(seen)), domain, how))),
                seen,
                domain,
                region,
            )
        ]

    return method


def nearest_layout(database: Sequence[LayoutRecord]) -> Method:
    """The hidden part of the database's layout that agrees best with what is seen, stretched to the domain."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        best, most = _NOTHING, -1.0
        wanted = element_rows(seen)
        for record in database:
            rows = element_rows(record.elements)
            origin, size = np.array(record.domain[:2]), np.subtract(record.domain[2:], record.domain[:2])
            scale = np.subtract(domain[2:], domain[:2]) / size
            rows[:, 1:] = (rows[:, 1:] - np.tile(origin, 2)) * np.tile(scale, 2) + np.tile(domain[:2], 2)
            visible = overlap_mask(rows[:, 1:], np.array(region)).any(axis=1)
            agrees = (pairwise_iou(wanted[:, 1:], rows[visible, 1:]) >= 0.3) & (wanted[:, :1] == rows[visible, 0])
            share = 2 * agrees.any(axis=1).sum() / (len(wanted) + visible.sum())
            if share > most:
                best, most = rows[~visible], share
        return [remove_rows_outside(best, seen, domain, region)]

    return method


def ours(model: LayoutModel, n: int) -> Method:
    """`complete`; n completions."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        return [list(c.elements[len(seen) :]) for c in complete(seen, domain, region, n=n, model=model)]

    return method
