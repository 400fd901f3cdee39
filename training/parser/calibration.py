"""Fit of the calibration of a parser's confidence to photos with labels (`facade_core.parsing.confidence`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypedDict

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.types import Element, Parsing
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.rectangles import pairwise_iou
from facade_core.parsing.confidence import (
    COVERAGE,
    MIN_UNCERTAINTY,
    FacadeStatistics,
    box_coverage,
    hidden_statistics,
    log_odds,
    statistics_uncertainty,
)
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import count_floors
from training.datasets.facades import ANY_CLASS

# An element is correct if a true one of its class overlaps it by this intersection over union.
MIN_IOU = 0.5
# Elements with a larger share of unknown true labels are not compared.
_MAX_UNKNOWN_SHARE = 0.05
# A window counts if the truth labels this share of it, or if a true window overlaps it.
_MIN_LABELLED_SHARE = 0.5


class ParseComparison(NamedTuple):
    """Comparison of one photo's parse with its true labels, as input of a calibration.

    Attributes
    ----------
    found : compared elements.
    is_correct : (n,) bool.
    misses : absolute errors of the figures.
    uncertainty : see `statistics_uncertainty`.
    hidden_part : possible errors in hidden parts.
    """

    found: list[Element]
    is_correct: BoolArray
    misses: FacadeStatistics
    uncertainty: FacadeStatistics
    hidden_part: FacadeStatistics


def compare_parse_with_truth(parsing: Parsing, truth: UInt8Array, possible: UInt8Array) -> ParseComparison:
    """Compare a parse with true labels, where these are known.

    Parameters
    ----------
    parsing : parse of the photo.
    truth : (h, w) class, UNKNOWN without.
    possible : (h, w) bit i set where class i is possible, all bits where nothing is known. Pixels that may be a window,
        such as a blind, count as part of it.
    """
    is_known = truth < len(CLASSES)
    elements_found = [
        element for element in elements(parsing) if box_coverage(~is_known, element) <= _MAX_UNKNOWN_SHARE
    ]
    share, true_share = (float((labels[is_known] == FacadeClass.WINDOW).mean()) for labels in (parsing.labels, truth))
    windows, counts, true_counts = _comparable_counts(parsing, truth, possible)
    value = FacadeStatistics(share, *counts)
    doubt = statistics_uncertainty(
        parsing.confidence[..., FacadeClass.WINDOW][is_known], value, np.zeros(int(is_known.sum()), bool)
    )
    misses = FacadeStatistics(
        *(abs(figure - true_figure) for figure, true_figure in zip(value, (true_share, *true_counts), strict=True))
    )
    hidden_part = hidden_statistics(value, windows, parsing.occluded)
    return ParseComparison(
        elements_found, mark_matched_elements(elements_found, elements(truth)), misses, doubt, hidden_part
    )


def _comparable_counts(
    parsing: Parsing, truth: UInt8Array, possible: UInt8Array
) -> tuple[list[Element], tuple[int, int], tuple[int, int]]:
    """Windows of a parse where the truth is known; numbers of windows and floors of the parse, and of the truth."""
    is_labelled = possible != ANY_CLASS
    window_or_wall = np.where((possible >> FacadeClass.WINDOW) & 1, FacadeClass.WINDOW, FacadeClass.WALL)
    true = np.where(truth < len(CLASSES), truth, np.where(is_labelled, window_or_wall, UNKNOWN)).astype(np.uint8)
    windows, true_windows = (
        [element for element in elements(labels) if element.label == "window"] for labels in (parsing.labels, true)
    )
    on_true = pairwise_iou(box_array(windows), box_array(true_windows)).max(axis=1, initial=0) > 0
    windows = [
        window
        for window, overlaps_true in zip(windows, on_true.tolist(), strict=True)
        if overlaps_true or box_coverage(is_labelled, window) >= _MIN_LABELLED_SHARE
    ]
    rows, columns = (np.flatnonzero(is_labelled.any(axis)) for axis in (1, 0))
    inside = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    floors, true_floors = (
        count_floors(np.where(is_labelled, labels, FacadeClass.WALL)[inside].astype(np.uint8))
        for labels in (parsing.labels, true)
    )
    return windows, (len(windows), floors), (len(true_windows), true_floors)


def mark_matched_elements(found: Sequence[Element], true: Sequence[Element]) -> BoolArray:
    """Mark the parsed elements that match a true element of their class, one to one by IoU.

    Parameters
    ----------
    found : parsed elements.
    true : true elements.

    Returns
    -------
    (n,) bool per parsed element.
    """
    from scipy.optimize import linear_sum_assignment

    is_correct = np.zeros(len(found), bool)
    for name in {element.label for element in found}:
        indices = [index for index, element in enumerate(found) if element.label == name]
        own, others = [found[index] for index in indices], [element for element in true if element.label == name]
        overlap = pairwise_iou(box_array(own), box_array(others))
        overlap[overlap < MIN_IOU] = 0
        rows, columns = linear_sum_assignment(overlap, maximize=True)
        is_correct[np.array(indices)[rows[overlap[rows, columns] > 0]]] = True
    return is_correct


class CalibrationRecord(TypedDict):
    """Calibration of a network in its record.

    Attributes
    ----------
    elements : slope and offset of the log odds of each class.
    widths : factor on each figure of `FacadeStatistics`.
    """

    elements: dict[str, list[float]]
    widths: dict[str, float]


def fit_calibration(photos: Sequence[ParseComparison]) -> CalibrationRecord:
    """Fit the calibration record of a network from observations on at least one photo."""
    outcomes: dict[str, list[tuple[float, bool]]] = {}
    for element, is_right in (
        pair for observation in photos for pair in zip(observation.found, observation.is_correct.tolist(), strict=True)
    ):
        outcomes.setdefault(element.label, []).append((element.confidence, is_right))
    lines = {name: _fit_line(np.array(outcomes.get(name, ()), float).reshape(-1, 2)) for name in ELEMENT_CLASSES}
    misses, doubted, unseen = (
        np.array(column, float) for column in zip(*(observation[2:] for observation in photos), strict=True)
    )
    # a facade without storeys is unsure of none
    ratios = np.sort(np.maximum(0, misses - unseen) / np.maximum(doubted, MIN_UNCERTAINTY), axis=0)
    place = min(len(ratios), math.ceil((len(ratios) + 1) * COVERAGE))
    widths = FacadeStatistics(*ratios[place - 1].tolist())
    return {"elements": lines, "widths": {name: round(width, 4) for name, width in widths._asdict().items()}}


def _fit_line(outcomes: Float64Array) -> list[float]:
    """Slope (not negative) and offset of highest likelihood for outcomes (n, 2) of confidence and truth.

    Platt's own targets avoid certainty from few outcomes. A class without outcomes keeps its confidence.
    """
    from scipy.optimize import minimize

    if not len(outcomes):
        return [1.0, 0.0]
    odds, truth = np.array([log_odds(value) for value in outcomes[:, 0]]), outcomes[:, 1]
    good, bad = truth.sum(), (1 - truth).sum()
    target = np.where(truth == 1, (good + 1) / (good + 2), 1 / (bad + 2))

    def loss(line: Float64Array) -> float:
        logits = line[0] * odds + line[1]
        return float((np.logaddexp(0, logits) - target * logits).sum())

    slope, offset = minimize(loss, np.array([1.0, 0.0]), bounds=[(0, None), (None, None)]).x
    return [round(float(slope), 4), round(float(offset), 4)]
