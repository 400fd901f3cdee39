"""What the trees of completion learn from, facades with a part hidden; and how likely an element must be to be picked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout import training_cases
from facade_core.facade.layout.facade_frame import Box, frame
from facade_core.facade.layout.grids import boxes, grids
from facade_core.facade.layout.model import LayoutModel
from facade_core.facade.layout.proposal_features import describe
from facade_core.facade.layout.proposals import propose
from facade_core.facade.layout.ranking import Trees, probability, train_trees
from facade_core.facade.layout.rectangles import iou
from facade_core.facade.layout.selection import pick

Layout = tuple[Sequence[Element], Box]
Progress = Callable[[str, int, int], None]

# A proposal is right when it overlaps a hidden element of its label by this share of their union.
_RIGHT = 0.5
# So many regular facades are made for a hundred of the database, which has few: what is regular is told as surely as it is.
_REGULAR = 30
# Thresholds that are tried.
_TRIED = np.geomspace(0.05, 0.5, 13).round(3)
_NOTHING = np.zeros((0, 4))
# Trees that choose them are of few facades, and need no more rounds.
_ROUNDS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """Proposals for a facade with a part hidden.

    layout: its number in the database, -1 of one that is made; measured: hidden as the benchmark hides, no mirror image;
    box (N, 4), label (N,), rows (N, features), truth (N,) bool: the proposals, and which are right; hidden (LABELS,): elements.
    """

    layout: int
    measured: bool
    box: np.ndarray
    label: np.ndarray
    rows: np.ndarray
    truth: np.ndarray
    hidden: np.ndarray


def examples(model: LayoutModel, layouts: Sequence[Layout], seed: int, progress: Progress) -> list[Example]:
    """Proposals for every facade, for its mirror image and for regular ones, with each kind of part hidden."""
    found = []
    regular = [
        training_cases.regular(np.random.default_rng([seed, 4, k])) for k in range(_REGULAR * len(layouts) // 100)
    ]
    everything = [
        *layouts,
        *((training_cases.mirror(elements, domain), domain) for elements, domain in layouts),
        *regular,
    ]
    for k, (elements, domain) in enumerate(everything):
        # the left half and the upper one teach the same as the right and the lower, so they take turns
        for turn, kind in enumerate((*training_cases.MEASURED, ("left", "upper")[k % 2], "region", "sparse")):
            seen, region = training_cases.hide(kind, elements, domain, np.random.default_rng([seed, k, turn]))
            shown = set(seen)
            hidden = [e for e in elements if e not in shown]
            if not seen or not hidden:
                continue
            visible = np.array(region, float).reshape(-1, 4)
            fitted = grids(seen)
            guesses = propose(seen, fitted, domain, visible, model.usual)
            if not len(guesses.box):
                continue
            label = np.array([ELEMENT_CLASSES.index(e.label) for e in hidden])
            overlap = iou(guesses.box, boxes(hidden)) * (guesses.label[:, None] == label)
            found.append(
                Example(
                    k % len(layouts) if k < 2 * len(layouts) else -1,
                    k < len(layouts) and turn < len(training_cases.MEASURED),
                    guesses.box,
                    guesses.label,
                    describe(guesses, seen, fitted, frame(seen, domain), domain, visible),
                    overlap.max(axis=1) >= _RIGHT,
                    np.bincount(label, minlength=len(ELEMENT_CLASSES)),
                )
            )
        progress("examples", k + 1, len(everything))
    return found


def trained(shown: Sequence[Example], *, seed: int, rounds: int = 400) -> Trees:
    """Trees that say how likely a proposal is right."""
    rows, truth = np.concatenate([e.rows for e in shown]), np.concatenate([e.truth for e in shown])
    return train_trees(rows, truth, seed=seed, rounds=rounds)


def likely(shown: Sequence[Example], *, seed: int, progress: Progress) -> np.ndarray:
    """(LABELS,) how likely a proposal must be to be picked: where F1 of its label is largest, on each half of the database by
    trees that learned from the other."""
    judged: list[tuple[Example, np.ndarray]] = []
    measured = [e for e in shown if e.measured]
    for half in (0, 1):
        trees = trained([e for e in measured if e.layout % 2 != half], seed=seed, rounds=_ROUNDS)
        judged += [(e, probability(trees, e.rows)) for e in measured if e.layout % 2 == half]
        progress("trees", 2 + half, 3)
    chosen = np.full(len(ELEMENT_CLASSES), 0.2)
    for label in (*range(len(ELEMENT_CLASSES)), *range(len(ELEMENT_CLASSES))):
        best = -1.0
        current = chosen.copy()
        for threshold in _TRIED.tolist():
            current[label] = threshold
            value = _f1(judged, current, label)
            if value > best:
                best, chosen[label] = value, threshold
    return chosen


def _f1(judged: Sequence[tuple[Example, np.ndarray]], thresholds: np.ndarray, label: int) -> float:
    right = made = hidden = 0
    for e, p in judged:
        kept = pick(e.box, e.label, p, p >= thresholds[e.label], _NOTHING)
        kept = kept[e.label[kept] == label]
        right, made, hidden = right + int(e.truth[kept].sum()), made + len(kept), hidden + int(e.hidden[label])
    return 2 * right / max(made + hidden, 1)
