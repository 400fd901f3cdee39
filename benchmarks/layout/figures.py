"""Figures of one method on cases made from whole layouts."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.papers.completion import Method, element_rows
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle, fit_columns_and_floors
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.rectangles import labels_may_overlap, overlap_mask, pairwise_iou
from training.layout import cases as training_cases


def matches(truth: Sequence[Element], proposed: Sequence[Element], threshold: float) -> np.ndarray:
    """(LABELS, 3) pairs of one label that reach the IoU threshold, one to one; proposed; true."""
    from scipy.optimize import linear_sum_assignment

    counts = np.zeros((len(ELEMENT_CLASSES), 3))
    for k, label in enumerate(ELEMENT_CLASSES):
        a, b = (box_array([e for e in s if e.label == label]) for s in (truth, proposed))
        good = pairwise_iou(a, b) >= threshold
        counts[k] = good[linear_sum_assignment(~good)].sum(), len(b), len(a)
    return counts


def f1(counts: np.ndarray) -> float:
    """F1 from (matched, proposed, true) counts."""
    return round(float(2 * counts[0] / max(counts[1] + counts[2], 1)), 3)


def _errors(seen: list[Element], hidden: list[Element], proposed: list[Element], domain: Rectangle) -> list[float]:
    """Errors of spacing, alignment and count; whether floors are as many; pairs that overlap; elements outside the domain."""
    truth = fit_columns_and_floors([*seen, *hidden], domain)
    guess = fit_columns_and_floors([*seen, *proposed], domain)
    spacing = np.nan
    if len(truth.columns) > 1 and len(guess.columns) > 1:
        wide = float(np.median(np.diff(truth.columns)))
        spacing = abs(float(np.median(np.diff(guess.columns))) / wide - 1)
    window = box_array([e for e in proposed if e.label == "window"])
    away = np.abs((window[:, [0]] + window[:, [2]]) / 2 - truth.columns) / truth.size[0]
    aligned = float(np.minimum(away.min(axis=1), 1).mean()) if away.size else np.nan
    rows = element_rows([*proposed, *seen])
    both = overlap_mask(rows[:, 1:], rows[:, 1:]) & ~labels_may_overlap(rows[:, 0], rows[:, 0])
    np.fill_diagonal(both, False)
    new = rows[: len(proposed), 1:]
    outside = ((new[:, :2] < domain[:2]) | (new[:, 2:] > domain[2:])).any(axis=1).sum()
    floors = float(len(truth.floors) == len(guess.floors))
    return [
        spacing,
        aligned,
        abs(len(proposed) - len(hidden)) / len(hidden),
        floors,
        both[: len(proposed)].sum(),
        outside,
    ]


def run(
    records: Sequence[LayoutRecord], method: Method, kinds: Sequence[str] = training_cases.BENCHMARK_KINDS
) -> dict[str, Any]:
    """The figures of one method by kind of case, the best of the layouts it gives counting; and all kinds together."""
    report: dict[str, Any] = {}
    everything = np.zeros((2, len(ELEMENT_CLASSES), 3))
    means: list[float] = []
    for kind in kinds:
        counts, errors, start, number = np.zeros_like(everything), [], time.process_time(), 0
        own: list[float] = []
        for i, record in enumerate(records):
            elements, domain = list(record.elements), record.domain
            seen, region = training_cases.hide_part(kind, elements, domain, np.random.default_rng([0, i]))
            hidden = [e for e in elements if e not in set(seen)]
            if not seen or not hidden:
                continue
            number += 1
            options = method(seen, domain, region)
            measured = [np.stack([matches(hidden, option, t) for t in (0.5, 0.3)]) for option in options]
            best = int(np.argmax([f1(m[0].sum(axis=0)) for m in measured]))
            counts += measured[best]
            own.append(f1(measured[best][0].sum(axis=0)))
            errors.append(_errors(seen, hidden, options[best], domain))
        everything += counts
        means += own
        mean = np.nanmean(np.array(errors), axis=0).round(3).tolist()
        report[kind] = {
            **_figures(counts, own),
            **dict(zip(("spacing", "alignment", "count", "floors right"), mean[:4], strict=True)),
            **dict(
                zip(("overlaps", "outside"), np.sum([e[4:] for e in errors], axis=0).astype(int).tolist(), strict=True)
            ),
            "cases": number,
            "cpu seconds a case": round((time.process_time() - start) / max(number, 1), 3),
        }
    report["all"] = _figures(everything, means)
    return report


def _figures(counts: np.ndarray, own: Sequence[float]) -> dict[str, Any]:
    """Figures over all elements, and the mean F1 over cases."""
    by_label = {label: f1(counts[0, k]) for k, label in enumerate(ELEMENT_CLASSES)}
    total = counts[0].sum(axis=0)
    return {
        "f1@0.5": f1(total),
        "f1@0.3": f1(counts[1].sum(axis=0)),
        "mean f1@0.5": round(float(np.mean(own)), 3) if own else 0.0,
        "proposed per true": round(float(total[1] / max(total[2], 1)), 3),
        "by label": by_label,
    }
