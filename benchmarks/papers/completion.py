"""Completion of layouts by the layout paper's own search, and by two methods that it is compared with.

References
----------
Fan et al. 2014, section 5 and Fig. 14.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.papers.policy import roll_out_policy
from benchmarks.papers.policy_optimisation import (
    evolve_policy_candidates,
    observed_layout_arrays,
    score_candidate_layout,
)
from facade_core.core.arrays import BoolArray
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.model import LayoutModel
from facade_core.facade.layout.rectangles import labels_may_overlap, overlap_mask
from facade_core.facade.layout.selection import select_proposals

Method = Callable[[list[Element], Rectangle, list[Rectangle]], list[list[Element]]]
# Of the policy search: generations of ten policies, completions a policy; as many candidates as the paper's.
SEARCH = (50, 20)
# The same where many searches are compared.
SHORT_SEARCH = (5, 4)


def remove_rows_outside(
    rows: np.ndarray, seen: list[Element], domain: Rectangle, region: list[Rectangle]
) -> list[Element]:
    """Rows (N, 5) of label and corners, first come first served, without what overlaps, was seen or lies outside."""
    box, label = rows[:, 1:], rows[:, 0].astype(int)
    inside: BoolArray = np.all(box[:, :2] >= domain[:2], axis=1) & np.all(box[:, 2:] <= domain[2:], axis=1)
    other = np.array([ELEMENT_CLASSES.index(e.label) for e in seen], int)
    inside &= ~np.any(overlap_mask(box, box_array(seen)) & ~labels_may_overlap(label, other), axis=1)
    kept = select_proposals(box, label, -np.arange(len(box), dtype=float), inside, np.array(region))
    return [Element(ELEMENT_CLASSES[label[i]], *box[i].tolist()) for i in np.sort(kept)]


def element_rows(elements: Sequence[Element]) -> np.ndarray:
    found = [(ELEMENT_CLASSES.index(e.label), e.x0, e.y0, e.x1, e.y1) for e in elements]
    return np.array(found, float).reshape(-1, 5)


def low_rank(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
    """Each label's occupancy on a raster of 64 x 64, its hidden cells filled by a matrix of rank two."""
    from scipy import ndimage

    side = 64
    scale = side / np.subtract(domain[2:], domain[:2])

    def cells(b: Sequence[float]) -> tuple[slice, slice]:
        x0, y0, x1, y1 = np.rint((np.array(b) - np.tile(domain[:2], 2)) * np.tile(scale, 2)).astype(int).clip(0, side)
        return slice(y0, y1), slice(x0, x1)

    visible = np.zeros((side, side), bool)
    for r in region:
        visible[cells(r)] = True
    found = []
    for number, label in enumerate(ELEMENT_CLASSES):
        filled = np.zeros((side, side))
        for e in seen:
            if e.label == label:
                filled[cells((e.x0, e.y0, e.x1, e.y1))] = 1
        truth, hidden_mean = filled.copy(), filled[visible].mean() if visible.any() else 0.0
        filled[~visible] = hidden_mean
        for _ in range(15):
            u, s, v = np.linalg.svd(filled, full_matrices=False)
            filled = np.where(visible, truth, (u[:, :2] * s[:2]) @ v[:2])
        parts, _ = ndimage.label((filled > 0.5) & ~visible)
        for rows, columns in ndimage.find_objects(parts):
            corners = np.array([columns.start, rows.start, columns.stop, rows.stop]) / np.tile(scale, 2)
            found.append([number, *(corners + np.tile(domain[:2], 2))])
    return [remove_rows_outside(np.array(found, float).reshape(-1, 5), seen, domain, region)]


def annealing(model: LayoutModel, steps: int = 400) -> Method:
    """Add, delete or move single elements by simulated annealing on our own score, as the paper's Fig. 14 does."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        rng = np.random.default_rng(0)
        start = observed_layout_arrays(seen, domain, np.array(region), model)
        first = element_rows(seen)
        rows, grid = first.copy(), start.grid.copy()

        def value(rows: np.ndarray, grid: np.ndarray) -> float:
            _, contiguous = np.unique(grid, return_inverse=True)
            return score_candidate_layout(
                np.ascontiguousarray(rows[:, 1:]), rows[:, 0].astype(np.int64), contiguous.astype(np.int64),
                start.domain, model,
            )  # fmt: skip

        current = value(rows, grid)
        for step in range(steps):
            extent = np.subtract(domain[2:], domain[:2])
            move, tried, tried_grid = rng.integers(3), rows.copy(), grid.copy()
            if move == 0:
                k = rng.integers(len(first))
                shift = rng.uniform(size=2) * extent + domain[:2] - first[k, 1:3]
                tried = np.vstack([rows, first[k] + np.array([0, *shift, *shift])])
                tried_grid = np.append(grid, start.grid[k])
            elif len(rows) == len(first):
                continue
            else:
                k = rng.integers(len(first), len(rows))
                if move == 1:
                    tried, tried_grid = np.delete(rows, k, axis=0), np.delete(grid, k)
                else:
                    tried[k, 1:] += np.tile(rng.normal(size=2) * 0.05 * extent, 2)
            added = tried[len(first) :]
            if len(remove_rows_outside(added, seen, domain, region)) < len(added):
                continue
            new = value(tried, tried_grid)
            if new > current or rng.uniform() < np.exp((new - current) / (0.3 * (1 - step / steps) + 1e-3)):
                rows, grid, current = tried, tried_grid, new
        return [remove_rows_outside(rows[len(first) :], seen, domain, region)]

    return method


def policy_search(model: LayoutModel, search: tuple[int, int] = SEARCH) -> Method:
    """The paper's own method: the layout of the policy search with the best score."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        start = observed_layout_arrays(seen, domain, np.array(region), model)
        used, seeds, scores = evolve_policy_candidates(model.policies, start, model, *search, 0)
        box, label, _ = roll_out_policy(used[scores.argmax()], start, int(seeds[scores.argmax()]))
        return [remove_rows_outside(np.column_stack([label, box])[len(seen) :], seen, domain, region)]

    return method
