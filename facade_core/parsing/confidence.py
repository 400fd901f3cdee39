"""How sure a parse is, by what came true on photos that the network neither learnt from nor is measured on.

A network's own confidence is no probability: it is put right by Platt's scaling (1999), a straight line on its log odds, for
each class of elements; the window share and the numbers of windows and storeys get intervals by split conformal prediction
(Papadopoulos et al. 2002).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from facade_core.core.errors import ModelError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.model_file import file_stamps, read_model_record
from facade_core.core.types import Element, Parsing
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import count_floors
from facade_core.parsing.network import SHIPPED_NETWORK

# An element is right where a true one of its class overlaps it by this much (intersection over union).
LEAST_OVERLAP = 0.5
# The share of facades whose true figure an interval is to hold.
COVERAGE = 0.9
# An element is compared where no more than this share of it is without a true label.
_MOST_UNKNOWN = 0.05
# A window is counted where this share of it has a label that tells whether it is one, or where it lies on a true one.
_LEAST_TOLD = 0.5
# Of the windows and storeys that are taken to be where nothing is seen, so many may be wrong, or missing.
_MADE_UP_WRONG = 0.5
# A row of pixels is hidden where this share of it is.
_HIDDEN_ROW = 0.9
# Added to what a parse is unsure of, as a share of the facade: none is surer than this. And what is hidden may be windows for
# at least this share, whatever is seen.
_LEAST_UNSURE, _LEAST_SHARE = 0.005, 0.15
# Confidences are taken no nearer to 0 and 1 than this.
_SUREST = 1e-3


class FacadeFigures(NamedTuple):
    """One number each of the share of a facade that its windows are, their number, and the number of its storeys."""

    window_share: float
    windows: float
    floors: float


class FacadeEstimates(NamedTuple):
    """What a parse says of a facade as a whole, and the least and the most of each that holds the truth in COVERAGE of facades;
    floors: 0 where it shows no windows."""

    value: FacadeFigures
    low: FacadeFigures
    high: FacadeFigures


@dataclass(frozen=True, slots=True)
class Calibration:
    """lines: class -> (slope, offset) of the log odds that an element is right over those of its confidence; widths: half of
    an interval's width for each unit that a parse is unsure of, as in `doubts`."""

    lines: Mapping[str, tuple[float, float]]
    widths: FacadeFigures

    def element_probability(self, element: Element) -> float:
        """That a parsed element is right."""
        slope, offset = self.lines[element.label]
        return 1 / (1 + math.exp(-(slope * _log_odds(element.confidence) + offset)))

    def estimate(self, parsing: Parsing, found: Sequence[Element], hidden: np.ndarray) -> FacadeEstimates:
        """What a parse and the elements found in it say of a facade. Nothing is known of what is hidden (h, w) bool, and half
        of the windows and storeys that are taken to be there may be wrong."""
        value = _figures(parsing.labels, found)
        doubt, unseen = (
            figure_uncertainty(parsing.confidence[..., FacadeClass.WINDOW], value, hidden),
            _unseen(value, found, hidden),
        )
        share, windows, floors = self.half_widths(doubt, unseen)
        return FacadeEstimates(
            value,
            FacadeFigures(
                max(0.0, value.window_share - share),
                max(0, math.ceil(value.windows - windows)),
                max(min(1, value.floors), math.ceil(value.floors - floors)),
            ),
            FacadeFigures(
                min(1.0, value.window_share + share),
                math.floor(value.windows + windows),
                math.floor(value.floors + floors),
            ),
        )

    def half_widths(self, doubt: FacadeFigures, unseen: FacadeFigures) -> FacadeFigures:
        """Half of the intervals' widths: what a parse is unsure of, and what is hidden."""
        return FacadeFigures(*(width * one + more for width, one, more in zip(self.widths, doubt, unseen, strict=True)))


def load_calibration(model: str | Path | None = None) -> Calibration:
    """Of a network's file, the shipped one without a model. Raises ModelError where its .json says nothing of it."""
    path = SHIPPED_NETWORK if model is None else Path(model)
    return _certainty(path.resolve(), file_stamps(path))


@functools.lru_cache(maxsize=2)
def _certainty(path: Path, _stamp: tuple[tuple[int, int], ...]) -> Calibration:
    record = read_model_record(path).get("certainty")
    try:
        lines = {name: (float(slope), float(offset)) for name, (slope, offset) in record["elements"].items()}  # type: ignore[index]
        widths = FacadeFigures(**{name: float(width) for name, width in record["widths"].items()})  # type: ignore[index]
        return Calibration({name: lines[name] for name in ELEMENT_CLASSES}, widths)
    except (TypeError, KeyError, ValueError) as error:
        raise ModelError(f"{path}: its .json does not say how sure it is; train it anew with this version") from error


def calibrate_elements(found: Sequence[Element], calibration: Calibration, hidden: np.ndarray) -> list[Element]:
    """Elements whose confidence is the probability that they are right, times the share of them that is not hidden (h, w) bool:
    what is made up was seen by nobody."""
    return [
        dataclasses.replace(element, confidence=calibration.element_probability(element) * (1 - masked_share(hidden, element)))
        for element in found
    ]


def masked_share(mask: np.ndarray, element: Element) -> float:
    """The share of an element's box that a mask (h, w) bool has."""
    part = mask[int(element.y0) : math.ceil(element.y1), int(element.x0) : math.ceil(element.x1)]
    return float(part.mean()) if part.size else 0.0


def expected_window_error(chance: np.ndarray, share: float, hidden: np.ndarray) -> float:
    """The share of a facade that is expected to be wrongly called a window, or not one. chance, hidden (...): that a pixel is a
    window, and whether it is hidden; share: of the facade that its windows are taken to be, which goes for what is hidden."""
    there = max(share, _LEAST_SHARE)
    doubt = np.where(hidden, min(there, 1 - there), np.minimum(chance, 1 - chance))
    return _LEAST_UNSURE + float(doubt.mean())


def figure_uncertainty(chance: np.ndarray, value: FacadeFigures, hidden: np.ndarray) -> FacadeFigures:
    """What a parse is unsure of, by which intervals are wider: a share of the facade; for counts, that of what is seen and the
    square root of the count, as many are missed by more, but by a smaller part of them."""
    seen = _LEAST_UNSURE + float(np.where(hidden, 0, np.minimum(chance, 1 - chance)).mean())
    share = expected_window_error(chance, value.window_share, hidden)
    return FacadeFigures(share, seen * math.sqrt(1 + value.windows), math.sqrt(seen * value.floors))


def _figures(labels: np.ndarray, found: Sequence[Element]) -> FacadeFigures:
    windows = sum(element.label == "window" for element in found)
    return FacadeFigures(float((labels == FacadeClass.WINDOW).mean()), windows, count_floors(labels))


def _unseen(value: FacadeFigures, found: Sequence[Element], hidden: np.ndarray) -> FacadeFigures:
    """How many of the windows, by those around or those made up, and storeys may be wrong for being hidden (h, w) bool. The
    doubt of the window share has it already."""
    made_up = sum(masked_share(hidden, element) for element in found if element.label == "window")
    share = float(hidden.mean())
    # where none is seen there may be one
    around = max(value.windows - made_up, 1) * share / max(1 - share, _LEAST_UNSURE)
    rows = float((hidden.mean(1) >= _HIDDEN_ROW).mean())
    return FacadeFigures(0.0, _MADE_UP_WRONG * max(made_up, around), _MADE_UP_WRONG * value.floors * rows)


class ParseObservation(NamedTuple):
    """How a parse compares with the truth: the elements found, which of them (n,) bool are right, by how much its figures were
    missed, what it was unsure of, and what was hidden by things in front."""

    found: list[Element]
    match_elements: np.ndarray
    misses: FacadeFigures
    figure_uncertainty: FacadeFigures
    unseen: FacadeFigures


def observe_parse(parsing: Parsing, truth: np.ndarray, possible: np.ndarray) -> ParseObservation:
    """A parse against true labels (h, w), where these are known. possible (h, w): bit i is set where class i may be, all bits
    where nothing is told; what may be a window, such as the blind before one, counts as part of it."""
    known = truth < len(CLASSES)
    found = [element for element in elements(parsing) if masked_share(~known, element) <= _MOST_UNKNOWN]
    share, true_share = (float((labels[known] == FacadeClass.WINDOW).mean()) for labels in (parsing.labels, truth))
    windows, counted, true_counted = _counts(parsing, truth, possible)
    value = FacadeFigures(share, *counted)
    doubt = figure_uncertainty(parsing.confidence[..., FacadeClass.WINDOW][known], value, np.zeros(int(known.sum()), bool))
    misses = FacadeFigures(*(abs(one - other) for one, other in zip(value, (true_share, *true_counted), strict=True)))
    unseen = _unseen(value, windows, parsing.occluded)
    return ParseObservation(found, match_elements(found, elements(truth)), misses, doubt, unseen)


def _counts(
    parsing: Parsing, truth: np.ndarray, possible: np.ndarray
) -> tuple[list[Element], tuple[int, int], tuple[int, int]]:
    """The windows of a parse where the truth tells whether there is one; how many, and how many storeys; and of the truth."""
    told = possible != (1 << len(CLASSES)) - 1
    maybe = np.where((possible >> FacadeClass.WINDOW) & 1, FacadeClass.WINDOW, FacadeClass.WALL)
    true = np.where(truth < len(CLASSES), truth, np.where(told, maybe, UNKNOWN)).astype(np.uint8)
    windows, true_windows = (
        [element for element in elements(of) if element.label == "window"] for of in (parsing.labels, true)
    )
    on_true = element_ious(windows, true_windows).max(axis=1, initial=0) > 0
    windows = [
        one for one, on in zip(windows, on_true.tolist(), strict=True) if on or masked_share(told, one) >= _LEAST_TOLD
    ]
    rows, columns = (np.flatnonzero(told.any(axis)) for axis in (1, 0))
    inside = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    floors, true_floors = (
        count_floors(np.where(told, of, FacadeClass.WALL)[inside].astype(np.uint8)) for of in (parsing.labels, true)
    )
    return windows, (len(windows), floors), (len(true_windows), true_floors)


def match_elements(found: Sequence[Element], true: Sequence[Element]) -> np.ndarray:
    """Which found elements (n,) bool are right: paired with true ones of their class, one to one, for the most IoU in all."""
    from scipy.optimize import linear_sum_assignment

    good = np.zeros(len(found), bool)
    for name in {element.label for element in found}:
        at = [index for index, element in enumerate(found) if element.label == name]
        overlap = element_ious([found[index] for index in at], [element for element in true if element.label == name])
        overlap[overlap < LEAST_OVERLAP] = 0
        rows, columns = linear_sum_assignment(overlap, maximize=True)
        good[np.array(at)[rows[overlap[rows, columns] > 0]]] = True
    return good


def element_ious(one: Sequence[Element], other: Sequence[Element]) -> np.ndarray:
    """IoU of every element with every other, (n, m)."""
    first, second = (np.array([(e.x0, e.y0, e.x1, e.y1) for e in some]).reshape(-1, 4) for some in (one, other))
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(2)
    areas = [(boxes[:, 2:] - boxes[:, :2]).prod(1) for boxes in (first, second)]
    return shared / np.maximum(areas[0][:, None] + areas[1][None] - shared, 1e-9)


def fit_calibration(photos: Sequence[ParseObservation]) -> dict[str, Any]:
    """What the .json of a network keeps as "certainty", from what was observed on photos, one at least."""
    seen: dict[str, list[tuple[float, bool]]] = {}
    for element, is_right in (pair for one in photos for pair in zip(one.found, one.right.tolist(), strict=True)):
        seen.setdefault(element.label, []).append((element.confidence, is_right))
    lines = {name: _line(np.array(seen.get(name, ()), float).reshape(-1, 2)) for name in ELEMENT_CLASSES}
    misses, doubted, unseen = (np.array(of, float) for of in zip(*(one[2:] for one in photos), strict=True))
    # a facade without storeys is unsure of none
    ratios = np.sort(np.maximum(0, misses - unseen) / np.maximum(doubted, _LEAST_UNSURE), axis=0)
    place = min(len(ratios), math.ceil((len(ratios) + 1) * COVERAGE))
    widths = FacadeFigures(*ratios[place - 1].tolist())
    return {"elements": lines, "widths": {name: round(width, 4) for name, width in widths._asdict().items()}}


def _line(seen: np.ndarray) -> list[float]:
    """Slope, which is not negative, and offset that make what was seen, (n, 2) of confidence and truth, likeliest; Platt's own
    targets keep few from being certain. Of a class that was not seen the confidence stays."""
    from scipy.optimize import minimize

    if not len(seen):
        return [1.0, 0.0]
    odds, truth = np.array([_log_odds(value) for value in seen[:, 0]]), seen[:, 1]
    good, bad = truth.sum(), (1 - truth).sum()
    target = np.where(truth == 1, (good + 1) / (good + 2), 1 / (bad + 2))

    def loss(line: np.ndarray) -> float:
        logits = line[0] * odds + line[1]
        return float((np.logaddexp(0, logits) - target * logits).sum())

    slope, offset = minimize(loss, np.array([1.0, 0.0]), bounds=[(0, None), (None, None)]).x
    return [round(float(slope), 4), round(float(offset), 4)]


def _log_odds(confidence: float) -> float:
    value = min(max(confidence, _SUREST), 1 - _SUREST)
    return math.log(value / (1 - value))
