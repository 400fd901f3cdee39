"""How sure a parse is, by what came true on photos that the network neither learnt from nor is measured on.

A network's own confidence is no probability: it is put right by Platt's scaling (1999), a straight line on its log odds, for
each class of elements; the window share gets an interval by split conformal prediction (Papadopoulos et al. 2002).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.errors import ModelError
from facade_core.labels import CLASSES, ELEMENT_CLASSES, WINDOW
from facade_core.parse.boxes import elements
from facade_core.parse.model_file import read_record, stamp
from facade_core.parse.network import SHIPPED
from facade_core.types import Element, Parsing

# An element is right where a true one of its class overlaps it by this much (intersection over union).
LEAST_OVERLAP = 0.5
# The share of facades whose true window share an interval is to hold.
COVERAGE = 0.9
# An element is compared where no more than this share of it is without a true label.
_MOST_UNKNOWN = 0.05
# Added to what a parse is unsure of, as a share of the facade: none is surer than this. And what is hidden may be windows for
# at least this share, whatever is seen.
_LEAST_UNSURE, _LEAST_SHARE = 0.005, 0.15
# Confidences are taken no nearer to 0 and 1 than this.
_SUREST = 1e-3


@dataclass(frozen=True, slots=True)
class Certainty:
    """lines: class -> (slope, offset) of the log odds that an element is right over those of its confidence; width: half of
    an interval's width for each unit that a parse is unsure of."""

    lines: Mapping[str, tuple[float, float]]
    width: float

    def probability(self, element: Element) -> float:
        """That a parsed element is right."""
        slope, offset = self.lines[element.label]
        return 1 / (1 + math.exp(-(slope * _log_odds(element.confidence) + offset)))

    def window_share(self, parsing: Parsing, hidden: np.ndarray) -> tuple[float, float, float]:
        """The share of a facade that its windows are, and the interval that holds the true one in COVERAGE of facades; of what
        is hidden (h, w) bool nothing is known."""
        share = float((parsing.labels == WINDOW).mean())
        half = self.width * unsure(parsing.confidence[..., WINDOW], share, hidden)
        return share, max(0.0, share - half), min(1.0, share + half)


def certainty(model: str | Path | None = None) -> Certainty:
    """Of a network's file, the shipped one without a model. Raises ModelError where its .json says nothing of it."""
    path = SHIPPED if model is None else Path(model)
    return _certainty(path.resolve(), stamp(path))


@functools.lru_cache(maxsize=2)
def _certainty(path: Path, _stamp: tuple[tuple[int, int], ...]) -> Certainty:
    record = read_record(path).get("certainty")
    try:
        lines = {name: (float(slope), float(offset)) for name, (slope, offset) in record["elements"].items()}  # type: ignore[index]
        return Certainty({name: lines[name] for name in ELEMENT_CLASSES}, float(record["width"]))  # type: ignore[index]
    except (TypeError, KeyError, ValueError) as error:
        raise ModelError(f"{path}: its .json does not say how sure it is; train it anew with this version") from error


def with_probabilities(found: Sequence[Element], sure: Certainty, hidden: np.ndarray) -> list[Element]:
    """Elements whose confidence is the probability that they are right, times the share of them that is not hidden (h, w) bool:
    what is made up was seen by nobody."""
    return [
        dataclasses.replace(element, confidence=sure.probability(element) * (1 - share_of(hidden, element)))
        for element in found
    ]


def share_of(mask: np.ndarray, element: Element) -> float:
    """The share of an element's box that a mask (h, w) bool has."""
    part = mask[int(element.y0) : math.ceil(element.y1), int(element.x0) : math.ceil(element.x1)]
    return float(part.mean()) if part.size else 0.0


def unsure(chance: np.ndarray, share: float, hidden: np.ndarray) -> float:
    """The share of a facade that is expected to be wrongly called a window, or not one. chance, hidden (...): that a pixel is a
    window, and whether it is hidden; share: of the facade that its windows are taken to be, which goes for what is hidden."""
    there = max(share, _LEAST_SHARE)
    doubt = np.where(hidden, min(there, 1 - there), np.minimum(chance, 1 - chance))
    return _LEAST_UNSURE + float(doubt.mean())


def observed(parsing: Parsing, truth: np.ndarray) -> tuple[list[Element], np.ndarray, float, float]:
    """Of a parse and the true labels (h, w): the elements found, which of them are right, by how much the window share was
    missed, and what the parse was unsure of; all where the truth is known."""
    known = truth < len(CLASSES)
    found = [element for element in elements(parsing) if share_of(~known, element) <= _MOST_UNKNOWN]
    share = float((parsing.labels[known] == WINDOW).mean())
    doubt = unsure(parsing.confidence[..., WINDOW][known], share, np.zeros(int(known.sum()), bool))
    return found, right(found, elements(truth)), abs(share - float((truth[known] == WINDOW).mean())), doubt


def right(found: Sequence[Element], true: Sequence[Element]) -> np.ndarray:
    """Which found elements (n,) bool are right: paired with true ones of their class, one to one, for the most IoU in all."""
    from scipy.optimize import linear_sum_assignment

    good = np.zeros(len(found), bool)
    for name in {element.label for element in found}:
        at = [index for index, element in enumerate(found) if element.label == name]
        overlap = overlaps([found[index] for index in at], [element for element in true if element.label == name])
        overlap[overlap < LEAST_OVERLAP] = 0
        rows, columns = linear_sum_assignment(overlap, maximize=True)
        good[np.array(at)[rows[overlap[rows, columns] > 0]]] = True
    return good


def overlaps(one: Sequence[Element], other: Sequence[Element]) -> np.ndarray:
    """IoU of every element with every other, (n, m)."""
    first, second = (np.array([(e.x0, e.y0, e.x1, e.y1) for e in some]).reshape(-1, 4) for some in (one, other))
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(2)
    areas = [(boxes[:, 2:] - boxes[:, :2]).prod(1) for boxes in (first, second)]
    return shared / np.maximum(areas[0][:, None] + areas[1][None] - shared, 1e-9)


def fit(seen: Mapping[str, Sequence[tuple[float, bool]]], misses: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """What the .json of a network keeps as "certainty". seen: class -> confidence and truth of the elements found; misses, one
    at least: by how much a facade's window share was missed, and what its parse was unsure of."""
    lines = {name: _line(np.array(seen.get(name, ()), float).reshape(-1, 2)) for name in ELEMENT_CLASSES}
    ratios = np.sort([miss / doubt for miss, doubt in misses])
    place = min(len(ratios), math.ceil((len(ratios) + 1) * COVERAGE))
    return {"elements": lines, "width": round(float(ratios[place - 1]), 4)}


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
