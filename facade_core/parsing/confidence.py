"""Calibrated confidence of a parse, from photos outside the training and the benchmark sets.

A network's own confidence is no probability. Platt's scaling (1999), a straight line on its log odds, calibrates it per
element class. The window share and the numbers of windows and floors get intervals by split conformal prediction
(Papadopoulos et al. 2002).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.model_file import file_stamps, read_model_record
from facade_core.core.types import Element, Parsing
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import count_floors
from facade_core.parsing.network import SHIPPED_NETWORK

# An element is correct if a true one of its class overlaps it by this intersection over union.
MIN_IOU = 0.5
# Share of facades whose true figure an interval contains.
COVERAGE = 0.9
# Elements with a larger share of unknown true labels are not compared.
_MAX_UNKNOWN_SHARE = 0.05
# A window counts if the truth labels this share of it, or if a true window overlaps it.
_MIN_LABELLED_SHARE = 0.5
# Share of the guessed windows and floors of hidden parts that may be wrong, or missing.
_HIDDEN_ERROR_SHARE = 0.5
# A row of pixels is hidden if this share of it is.
_MIN_HIDDEN_ROW_SHARE = 0.9
# Added to the uncertainty of a parse, as a share of the facade.
_MIN_UNCERTAINTY = 0.005
# Share of hidden parts that may be windows, at least.
_MIN_WINDOW_SHARE = 0.15
# Confidences are limited to this distance from 0 and 1.
_MIN_PROBABILITY = 1e-3


class FacadeStatistics(NamedTuple):
    """Window share, number of windows and number of floors, or one value for each of these."""

    window_share: float
    windows: float
    floors: float


class FacadeEstimates(NamedTuple):
    """Figures of a facade with intervals that contain the truth in COVERAGE of facades.

    Attributes
    ----------
    value : estimates; 0 floors where no windows are visible.
    low : lower ends of the intervals.
    high : upper ends.
    """

    value: FacadeStatistics
    low: FacadeStatistics
    high: FacadeStatistics


@dataclass(frozen=True, slots=True)
class Calibration:
    """Calibration of a parser model.

    Attributes
    ----------
    lines : class -> slope and offset of the calibrated log odds over those of the confidence.
    widths : half width of an interval per unit of uncertainty, see `statistics_uncertainty`.
    """

    lines: Mapping[str, tuple[float, float]]
    widths: FacadeStatistics

    def element_probability(self, element: Element) -> float:
        """Compute the probability that a parsed element is correct."""
        slope, offset = self.lines[element.label]
        return 1 / (1 + math.exp(-(slope * _log_odds(element.confidence) + offset)))

    def estimate(self, parsing: Parsing, elements_found: Sequence[Element], hidden: BoolArray) -> FacadeEstimates:
        """Estimate a facade's figures, with intervals that account for hidden parts.

        Parameters
        ----------
        parsing : parse of the facade.
        found : elements of the parse.
        hidden : (h, w) bool, pixels without an observation. Half of the windows and floors assumed there may be wrong.
        """
        value = _parse_figures(parsing.labels, elements_found)
        doubt, hidden_part = (
            statistics_uncertainty(parsing.confidence[..., FacadeClass.WINDOW], value, hidden),
            _hidden_figures(value, elements_found, hidden),
        )
        share, windows, floors = self.half_widths(doubt, hidden_part)
        return FacadeEstimates(
            value,
            FacadeStatistics(
                max(0.0, value.window_share - share),
                max(0, math.ceil(value.windows - windows)),
                max(min(1, value.floors), math.ceil(value.floors - floors)),
            ),
            FacadeStatistics(
                min(1.0, value.window_share + share),
                math.floor(value.windows + windows),
                math.floor(value.floors + floors),
            ),
        )

    def half_widths(self, doubt: FacadeStatistics, hidden_part: FacadeStatistics) -> FacadeStatistics:
        """Compute half the intervals' widths from the uncertainty and the hidden parts' error."""
        return FacadeStatistics(
            *(
                width * uncertainty + more
                for width, uncertainty, more in zip(self.widths, doubt, hidden_part, strict=True)
            )
        )


def load_calibration(model: str | Path | None = None) -> Calibration:
    """Load the calibration of a network's file, the shipped one by default.

    Raises
    ------
    ModelError
        If its .json has no calibration.
    """
    path = SHIPPED_NETWORK if model is None else Path(model)
    return _cached_calibration(path.resolve(), file_stamps(path))


@functools.lru_cache(maxsize=2)
def _cached_calibration(path: Path, _stamp: tuple[tuple[int, int], ...]) -> Calibration:
    record = read_model_record(path).get("certainty")
    try:
        lines = {name: (float(slope), float(offset)) for name, (slope, offset) in record["elements"].items()}  # type: ignore[index]
        widths = FacadeStatistics(**{name: float(width) for name, width in record["widths"].items()})  # type: ignore[index]
        return Calibration({name: lines[name] for name in ELEMENT_CLASSES}, widths)
    except (TypeError, KeyError, ValueError) as error:
        raise ModelFileError(
            f"{path}: its .json does not say how sure it is; train it anew with this version"
        ) from error


def calibrate_elements(elements_found: Sequence[Element], calibration: Calibration, hidden: BoolArray) -> list[Element]:
    """Replace the confidence of elements by the probability that they are correct.

    Parameters
    ----------
    found : parsed elements.
    calibration : calibration of the model.
    hidden : (h, w) bool; the hidden share of an element counts as unobserved.
    """
    return [
        dataclasses.replace(
            element, confidence=calibration.element_probability(element) * (1 - box_coverage(hidden, element))
        )
        for element in elements_found
    ]


def box_coverage(mask: BoolArray, element: Element) -> float:
    """Compute the share of an element's box that a mask (h, w) bool covers."""
    part = mask[int(element.y0) : math.ceil(element.y1), int(element.x0) : math.ceil(element.x1)]
    return float(part.mean()) if part.size else 0.0


def estimate_window_error_share(chance: Float32Array, share: float, hidden: BoolArray) -> float:
    """Estimate the share of a facade's pixels that are wrongly classed as window or as other.

    Parameters
    ----------
    chance : (...) probability that a pixel is a window.
    share : window share of the facade, assumed for hidden pixels.
    hidden : (...) bool.
    """
    window_share = max(share, _MIN_WINDOW_SHARE)
    error = np.where(hidden, min(window_share, 1 - window_share), np.minimum(chance, 1 - chance))
    return _MIN_UNCERTAINTY + float(error.mean())


def statistics_uncertainty(chance: Float32Array, value: FacadeStatistics, hidden: BoolArray) -> FacadeStatistics:
    """Compute the uncertainty that widens the intervals of a parse.

    For counts it is the uncertainty of the visible part times the square root of the count: the error of a large count
    is larger, but a smaller part of it.

    Parameters
    ----------
    chance : (...) probability that a pixel is a window.
    value : figures of the parse.
    hidden : (...) bool.
    """
    visible_error = _MIN_UNCERTAINTY + float(np.where(hidden, 0, np.minimum(chance, 1 - chance)).mean())
    share = estimate_window_error_share(chance, value.window_share, hidden)
    return FacadeStatistics(
        share, visible_error * math.sqrt(1 + value.windows), math.sqrt(visible_error * value.floors)
    )


def _parse_figures(labels: UInt8Array, elements_found: Sequence[Element]) -> FacadeStatistics:
    windows = sum(element.label == "window" for element in elements_found)
    return FacadeStatistics(float((labels == FacadeClass.WINDOW).mean()), windows, count_floors(labels))


def _hidden_figures(value: FacadeStatistics, elements_found: Sequence[Element], hidden: BoolArray) -> FacadeStatistics:
    """Return the numbers of windows and floors that may be wrong in hidden parts (h, w) bool.

    They follow from visible surroundings or guesses.

    The uncertainty of the window share already accounts for them.
    """
    guessed = sum(box_coverage(hidden, element) for element in elements_found if element.label == "window")
    share = float(hidden.mean())
    # one window may be hidden even where none is seen
    around = max(value.windows - guessed, 1) * share / max(1 - share, _MIN_UNCERTAINTY)
    rows = float((hidden.mean(1) >= _MIN_HIDDEN_ROW_SHARE).mean())
    return FacadeStatistics(0.0, _HIDDEN_ERROR_SHARE * max(guessed, around), _HIDDEN_ERROR_SHARE * value.floors * rows)


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
    hidden_part = _hidden_figures(value, windows, parsing.occluded)
    return ParseComparison(
        elements_found, mark_matched_elements(elements_found, elements(truth)), misses, doubt, hidden_part
    )


def _comparable_counts(
    parsing: Parsing, truth: UInt8Array, possible: UInt8Array
) -> tuple[list[Element], tuple[int, int], tuple[int, int]]:
    """Windows of a parse where the truth is known; numbers of windows and floors of the parse, and of the truth."""
    is_labelled = possible != (1 << len(CLASSES)) - 1
    window_or_wall = np.where((possible >> FacadeClass.WINDOW) & 1, FacadeClass.WINDOW, FacadeClass.WALL)
    true = np.where(truth < len(CLASSES), truth, np.where(is_labelled, window_or_wall, UNKNOWN)).astype(np.uint8)
    windows, true_windows = (
        [element for element in elements(labels) if element.label == "window"] for labels in (parsing.labels, true)
    )
    on_true = element_ious(windows, true_windows).max(axis=1, initial=0) > 0
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
        overlap = element_ious(
            [found[index] for index in indices], [element for element in true if element.label == name]
        )
        overlap[overlap < MIN_IOU] = 0
        rows, columns = linear_sum_assignment(overlap, maximize=True)
        is_correct[np.array(indices)[rows[overlap[rows, columns] > 0]]] = True
    return is_correct


def element_ious(one: Sequence[Element], other: Sequence[Element]) -> Float64Array:
    """Compute the IoU of every element with every other: (n, m)."""
    first, second = (np.array([(e.x0, e.y0, e.x1, e.y1) for e in side]).reshape(-1, 4) for side in (one, other))
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(2)
    areas = [(boxes[:, 2:] - boxes[:, :2]).prod(1) for boxes in (first, second)]
    ious: Float64Array = shared / np.maximum(areas[0][:, None] + areas[1][None] - shared, 1e-9)
    return ious


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
    ratios = np.sort(np.maximum(0, misses - unseen) / np.maximum(doubted, _MIN_UNCERTAINTY), axis=0)
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
    odds, truth = np.array([_log_odds(value) for value in outcomes[:, 0]]), outcomes[:, 1]
    good, bad = truth.sum(), (1 - truth).sum()
    target = np.where(truth == 1, (good + 1) / (good + 2), 1 / (bad + 2))

    def loss(line: Float64Array) -> float:
        logits = line[0] * odds + line[1]
        return float((np.logaddexp(0, logits) - target * logits).sum())

    slope, offset = minimize(loss, np.array([1.0, 0.0]), bounds=[(0, None), (None, None)]).x
    return [round(float(slope), 4), round(float(offset), 4)]


def _log_odds(confidence: float) -> float:
    value = min(max(confidence, _MIN_PROBABILITY), 1 - _MIN_PROBABILITY)
    return math.log(value / (1 - value))
