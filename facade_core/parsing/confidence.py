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
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, UInt8Array
from facade_core.core.errors import ModelFileError
from facade_core.core.labels import ELEMENT_CLASSES, FacadeClass
from facade_core.core.model_file import file_stamps, read_model_record
from facade_core.core.types import Element, Parsing
from facade_core.parsing.floor_structure import count_floors
from facade_core.parsing.network import SHIPPED_NETWORK

# Share of facades whose true figure an interval contains.
COVERAGE = 0.9
# Share of the guessed windows and floors of hidden parts that may be wrong, or missing.
_HIDDEN_ERROR_SHARE = 0.5
# A row of pixels is hidden if this share of it is.
_MIN_HIDDEN_ROW_SHARE = 0.9
# Added to the uncertainty of a parse, as a share of the facade.
MIN_UNCERTAINTY = 0.005
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
        return 1 / (1 + math.exp(-(slope * log_odds(element.confidence) + offset)))

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
            hidden_statistics(value, elements_found, hidden),
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
    return MIN_UNCERTAINTY + float(error.mean())


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
    visible_error = MIN_UNCERTAINTY + float(np.where(hidden, 0, np.minimum(chance, 1 - chance)).mean())
    share = estimate_window_error_share(chance, value.window_share, hidden)
    return FacadeStatistics(
        share, visible_error * math.sqrt(1 + value.windows), math.sqrt(visible_error * value.floors)
    )


def _parse_figures(labels: UInt8Array, elements_found: Sequence[Element]) -> FacadeStatistics:
    windows = sum(element.label == "window" for element in elements_found)
    return FacadeStatistics(float((labels == FacadeClass.WINDOW).mean()), windows, count_floors(labels))


def hidden_statistics(
    value: FacadeStatistics, elements_found: Sequence[Element], hidden: BoolArray
) -> FacadeStatistics:
    """Return the numbers of windows and floors that may be wrong in hidden parts (h, w) bool.

    They follow from visible surroundings or guesses.

    The uncertainty of the window share already accounts for them.
    """
    guessed = sum(box_coverage(hidden, element) for element in elements_found if element.label == "window")
    share = float(hidden.mean())
    # one window may be hidden even where none is seen
    around = max(value.windows - guessed, 1) * share / max(1 - share, MIN_UNCERTAINTY)
    rows = float((hidden.mean(1) >= _MIN_HIDDEN_ROW_SHARE).mean())
    return FacadeStatistics(0.0, _HIDDEN_ERROR_SHARE * max(guessed, around), _HIDDEN_ERROR_SHARE * value.floors * rows)


def log_odds(confidence: float) -> float:
    """Return the log odds of a confidence, limited near 0 and 1."""
    value = min(max(confidence, _MIN_PROBABILITY), 1 - _MIN_PROBABILITY)
    return math.log(value / (1 - value))
