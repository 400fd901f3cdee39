"""Training examples of the ranking trees, from facades with a part hidden, and selection thresholds by label."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, IntArray
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle, fit_columns_and_floors
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.model import LayoutModel
from facade_core.facade.layout.proposal_features import compute_features
from facade_core.facade.layout.proposals import propose_elements
from facade_core.facade.layout.ranking import BoostedTrees, predict_probability
from facade_core.facade.layout.rectangles import pairwise_iou
from facade_core.facade.layout.selection import select_proposals
from tasks.engine.progress import report_progress
from training.layout import cases as training_cases
from training.progress import track_progress

Layout = tuple[Sequence[Element], Rectangle]

# Smallest IoU of a correct proposal with a hidden element of its label.
_MIN_IOU = 0.5
# Regular facades for each hundred of the database, which has few: regular layouts need high probabilities.
_REGULAR_PERCENT = 30
# Candidate thresholds.
_THRESHOLDS = np.geomspace(0.05, 0.5, 13).round(3)
_NO_BOXES = np.zeros((0, 4))
# Rounds of the trees that choose thresholds; they learn from fewer facades.
_THRESHOLD_ROUNDS = 200


@dataclass(frozen=True, slots=True, eq=False)
class RankingExample:
    """Proposals with features and truth for a facade with a part hidden.

    Attributes
    ----------
    layout_index : index in the database, -1 of a synthetic layout.
    is_benchmark_case : hidden as in the benchmark, not a mirror image.
    box : (N, 4) proposals.
    label : (N,) index into ELEMENT_CLASSES.
    features : (N, features) float32.
    truth : (N,) bool correct proposals.
    hidden_counts : (LABEL_COUNT,) number of hidden elements.
    """

    layout_index: int
    is_benchmark_case: bool
    box: Float64Array
    label: IntArray
    features: Float32Array
    truth: BoolArray
    hidden_counts: Int64Array


def make_ranking_examples(model: LayoutModel, layouts: Sequence[Layout], seed: int) -> list[RankingExample]:
    """Make examples from every facade, its mirror image and regular facades, with each kind of part hidden."""
    found = []
    regular = [
        training_cases.sample_regular_layout(np.random.default_rng([seed, 4, k]))
        for k in range(_REGULAR_PERCENT * len(layouts) // 100)
    ]
    everything = [
        *layouts,
        *((training_cases.mirror_layout(elements, domain), domain) for elements, domain in layouts),
        *regular,
    ]
    for k, (elements, domain) in enumerate(track_progress("examples", everything, len(everything))):
        # The left and the upper half teach the same as the right and the lower, so they alternate.
        for turn, kind in enumerate((*training_cases.BENCHMARK_KINDS, ("left", "upper")[k % 2], "region", "sparse")):
            seen, region = training_cases.hide_part(kind, elements, domain, np.random.default_rng([seed, k, turn]))
            shown = set(seen)
            hidden = [e for e in elements if e not in shown]
            if not seen or not hidden:
                continue
            visible = np.array(region, float).reshape(-1, 4)
            fitted = fit_grids(seen)
            guesses = propose_elements(seen, fitted, domain, visible, model.priors)
            if not len(guesses.box):
                continue
            label = np.array([ELEMENT_CLASSES.index(e.label) for e in hidden])
            overlap = pairwise_iou(guesses.box, box_array(hidden)) * (guesses.label[:, None] == label)
            found.append(
                RankingExample(
                    k % len(layouts) if k < 2 * len(layouts) else -1,
                    k < len(layouts) and turn < len(training_cases.BENCHMARK_KINDS),
                    guesses.box,
                    guesses.label,
                    compute_features(guesses, seen, fitted, fit_columns_and_floors(seen, domain), domain, visible),
                    overlap.max(axis=1) >= _MIN_IOU,
                    np.bincount(label, minlength=len(ELEMENT_CLASSES)),
                )
            )
    return found


def train_ranking(examples: Sequence[RankingExample], *, seed: int, rounds: int = 400) -> BoostedTrees:
    """Train trees that predict the probability that a proposal is correct."""
    rows, truth = np.concatenate([e.features for e in examples]), np.concatenate([e.truth for e in examples])
    return train_trees(rows, truth, seed=seed, rounds=rounds)


def train_trees(rows: Float32Array, truth: BoolArray, *, seed: int, rounds: int) -> BoostedTrees:
    """Boost trees on features with known truth, in one thread so that results do not depend on the machine.

    Parameters
    ----------
    rows : (N, features) float32.
    truth : (N,) bool.
    seed : seed of the learner.
    rounds : number of trees.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    learner = HistGradientBoostingClassifier(
        max_iter=rounds,
        learning_rate=0.05,
        max_leaf_nodes=32,
        min_samples_leaf=60,
        l2_regularization=3.0,
        max_features=0.3,
        early_stopping=False,
        random_state=seed,
    )
    with threadpool_limits(1):
        learner.fit(rows, truth)
    roots, parts, offset = [], [], 0
    for (tree,) in learner._predictors:  # sklearn has no public access to its trees  # noqa: SLF001
        nodes = tree.nodes
        leaf = nodes["is_leaf"].astype(bool)
        roots.append(offset)
        parts.append(
            (
                np.where(leaf, -1, nodes["feature_idx"]),
                np.where(leaf, 0, nodes["num_threshold"]),
                np.where(leaf, 0, nodes["left"] + offset),
                np.where(leaf, 0, nodes["right"] + offset),
                np.where(leaf, nodes["value"], 0),
            )
        )
        offset += len(nodes)
    feature, threshold, left, right, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    return BoostedTrees(
        np.array(roots, np.int64),
        feature.astype(np.int64),
        threshold.astype(np.float32),
        left.astype(np.int64),
        right.astype(np.int64),
        np.round(value, 5),
        float(np.round(learner._baseline_prediction.item(), 5)),  # noqa: SLF001
    )


def choose_thresholds(examples: Sequence[RankingExample], *, seed: int) -> Float64Array:
    """Choose the probability from which proposals of each label are selected, at the largest F1.

    Each half of the database is judged by trees of the other half.

    Returns
    -------
    (LABEL_COUNT,) thresholds.
    """
    judged: list[tuple[RankingExample, Float64Array]] = []
    measured = [e for e in examples if e.is_benchmark_case]
    for half in (0, 1):
        trees = train_ranking([e for e in measured if e.layout_index % 2 != half], seed=seed, rounds=_THRESHOLD_ROUNDS)
        judged += [(e, predict_probability(trees, e.features)) for e in measured if e.layout_index % 2 == half]
        report_progress("trees", 1)
    chosen = np.full(len(ELEMENT_CLASSES), 0.2)
    for label in (*range(len(ELEMENT_CLASSES)), *range(len(ELEMENT_CLASSES))):
        best = -1.0
        current = chosen.copy()
        for threshold in _THRESHOLDS.tolist():
            current[label] = threshold
            value = _f1(judged, current, label)
            if value > best:
                best, chosen[label] = value, threshold
    return chosen


def _f1(judged: Sequence[tuple[RankingExample, Float64Array]], thresholds: Float64Array, label: int) -> float:
    right = made = hidden = 0
    for e, p in judged:
        kept = select_proposals(e.box, e.label, p, p >= thresholds[e.label], _NO_BOXES)
        kept = kept[e.label[kept] == label]
        right, made, hidden = right + int(e.truth[kept].sum()), made + len(kept), hidden + int(e.hidden_counts[label])
    return 2 * right / max(made + hidden, 1)
