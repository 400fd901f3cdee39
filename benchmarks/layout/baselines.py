"""What completion is measured against: simpler ways to fill the hidden part, and the paper's own search."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from catalogs.readers.layouts import LayoutRecord
from facade_core.core.arrays import BoolArray
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grid_extension import ExtensionVariant, extension_context, propose_extension_elements
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.model import LayoutModel
from facade_core.facade.layout.policy import roll_out_policy
from facade_core.facade.layout.policy_optimisation import (
    evolve_policy_candidates,
    observed_layout_arrays,
    score_candidate_layout,
)
from facade_core.facade.layout.rectangles import labels_may_overlap, overlap_mask, pairwise_iou
from facade_core.facade.layout.selection import select_proposals

Method = Callable[[list[Element], Rectangle, list[Rectangle]], list[list[Element]]]
# Of the policy search: generations of ten policies, completions a policy; as many candidates as the paper's.
SEARCH = (50, 20)
# The same where many searches are compared.
SHORT_SEARCH = (5, 4)
_NOTHING = np.zeros((0, 5))


def cleared(rows: np.ndarray, seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[Element]:
    """Rows (N, 5) of label and corners, first come first served, without what overlaps, was seen or lies outside."""
    box, label = rows[:, 1:], rows[:, 0].astype(int)
    inside: BoolArray = np.all(box[:, :2] >= domain[:2], axis=1) & np.all(box[:, 2:] <= domain[2:], axis=1)
    other = np.array([ELEMENT_CLASSES.index(e.label) for e in seen], int)
    inside &= ~np.any(overlap_mask(box, box_array(seen)) & ~labels_may_overlap(label, other), axis=1)
    kept = select_proposals(box, label, -np.arange(len(box), dtype=float), inside, np.array(region))
    return [Element(ELEMENT_CLASSES[label[i]], *box[i].tolist()) for i in np.sort(kept)]


def rows_of(elements: Sequence[Element]) -> np.ndarray:
    found = [(ELEMENT_CLASSES.index(e.label), e.x0, e.y0, e.x1, e.y1) for e in elements]
    return np.array(found, float).reshape(-1, 5)


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
    return [cleared(np.concatenate(found), seen, domain, region)]


def extension(how: ExtensionVariant) -> Method:
    """Grids carried on with filled gaps, own sizes, patterns and balconies."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        return [
            cleared(
                rows_of(list(propose_extension_elements(extension_context(seen, fit_grids(seen)), domain, how))),
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
        wanted = rows_of(seen)
        for record in database:
            rows = rows_of(record.elements)
            origin, size = np.array(record.domain[:2]), np.subtract(record.domain[2:], record.domain[:2])
            scale = np.subtract(domain[2:], domain[:2]) / size
            rows[:, 1:] = (rows[:, 1:] - np.tile(origin, 2)) * np.tile(scale, 2) + np.tile(domain[:2], 2)
            visible = overlap_mask(rows[:, 1:], np.array(region)).any(axis=1)
            agrees = (pairwise_iou(wanted[:, 1:], rows[visible, 1:]) >= 0.3) & (wanted[:, :1] == rows[visible, 0])
            share = 2 * agrees.any(axis=1).sum() / (len(wanted) + visible.sum())
            if share > most:
                best, most = rows[~visible], share
        return [cleared(best, seen, domain, region)]

    return method


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
    return [cleared(np.array(found, float).reshape(-1, 5), seen, domain, region)]


def annealing(model: LayoutModel, steps: int = 400) -> Method:
    """Add, delete or move single elements by simulated annealing on our own score, as the paper's Fig. 14 does."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        rng = np.random.default_rng(0)
        start = observed_layout_arrays(seen, domain, np.array(region), model)
        first = rows_of(seen)
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
            if len(cleared(added, seen, domain, region)) < len(added):
                continue
            new = value(tried, tried_grid)
            if new > current or rng.uniform() < np.exp((new - current) / (0.3 * (1 - step / steps) + 1e-3)):
                rows, grid, current = tried, tried_grid, new
        return [cleared(rows[len(first) :], seen, domain, region)]

    return method


def policy_search(model: LayoutModel, search: tuple[int, int] = SEARCH) -> Method:
    """The paper's own method: the layout of the policy search with the best score."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        start = observed_layout_arrays(seen, domain, np.array(region), model)
        used, seeds, scores = evolve_policy_candidates(model.policies, start, model, *search, 0)
        box, label, _ = roll_out_policy(used[scores.argmax()], start, int(seeds[scores.argmax()]))
        return [cleared(np.column_stack([label, box])[len(seen) :], seen, domain, region)]

    return method


def ours(model: LayoutModel, n: int) -> Method:
    """`complete`; n completions."""

    def method(seen: list[Element], domain: Rectangle, region: list[Rectangle]) -> list[list[Element]]:
        return [list(c.elements[len(seen) :]) for c in complete(seen, domain, region, n=n, model=model)]

    return method
