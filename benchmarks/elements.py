"""How far what is told of facades can be trusted: `python -m benchmarks.elements --data DIR` prints one JSON object.

Of photos that the parser neither learnt from nor was measured on for its certainty (`facade_core.parsing.confidence`): cmp's
and ecp's held-out folds, and artdeco, a style that it never saw. By class of elements: how often those found
are right (IoU of a
half with a true one) and the expected calibration error, over tenths, of the network's own confidence and of what is
published. Of the window share, and of the numbers of windows and storeys: how many facades are within five points of the truth,
or have its number, and how many intervals of 90 % hold it. What is not labelled is left out.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.parsing.confidence import FacadeStatistics, load_calibration
from facade_core.parsing.segmenter import parse
from training.datasets.facades import ARTDECO, CMP, ECP, LabelledFacade, read_dataset, split_facades_for_training
from training.parser.calibration import compare_parse_with_truth

_BINS = 10
# What counts as near the truth: five points of the window share, the very number of windows and storeys.
NEAR = FacadeStatistics(0.05, 0, 0)


def measure(facades: Iterable[LabelledFacade], model: Path | None) -> dict[str, Any]:
    sure = load_calibration(model)
    said: dict[str, list[tuple[float, float, bool]]] = {}
    misses: list[FacadeStatistics] = []
    halves: list[FacadeStatistics] = []
    for facade in facades:
        seen = compare_parse_with_truth(parse(facade.image, model=model), facade.labels, facade.possible)
        misses.append(seen.misses)
        halves.append(sure.half_widths(seen.uncertainty, seen.hidden_part))
        for element, is_right in zip(seen.found, seen.is_correct.tolist(), strict=True):
            said.setdefault(element.label, []).append((element.confidence, sure.element_probability(element), is_right))
    every = [one for of_class in said.values() for one in of_class]
    return {
        "elements": {name: calibration(of_class) for name, of_class in {**said, "all": every}.items()},
        **{
            name: held(np.array(miss), np.array(half), near)
            for name, near, miss, half in zip(
                FacadeStatistics._fields, NEAR, zip(*misses, strict=True), zip(*halves, strict=True), strict=True
            )
        },
        "images": len(misses),
    }


def held(misses: np.ndarray, halves: np.ndarray, near: float) -> dict[str, float]:
    """Of a figure of facades (n,), by misses and half the intervals' widths: the shares that are near the truth, and held."""
    if near == 0:  # ends of intervals of counts are whole
        halves = np.floor(halves)
    return {
        "near": round(float(np.mean(misses <= near)), 4),
        "mean_miss": round(float(np.mean(misses)), 4),
        "held_by_90_percent": round(float(np.mean(misses <= halves)), 4),
        "mean_half_width": round(float(np.mean(halves)), 4),
    }


def calibration(said: list[tuple[float, float, bool]]) -> dict[str, float]:
    """Of confidence, probability and truth of elements: how many, the share that is right, the expected calibration errors."""
    confidence, probability, good = np.array(said, float).T
    return {
        "found": len(good),
        "right": round(float(good.mean()), 4),
        "error_of_confidence": expected_error(confidence, good),
        "error_of_probability": expected_error(probability, good),
    }


def expected_error(probability: np.ndarray, good: np.ndarray) -> float:
    """The expected calibration error (Guo et al. 2017): over tenths of probability, how far its mean is from the share that
    came true, weighed by how many there are."""
    tenth = np.minimum((probability * _BINS).astype(int), _BINS - 1)
    off = [abs(probability[tenth == b].sum() - good[tenth == b].sum()) for b in range(_BINS)]
    return round(float(sum(off) / len(good)), 4)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Score how sure the parser says that it is.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/",
    )
    parser.add_argument("--model", type=Path, help="another .onnx file, with its .json beside it")
    options = parser.parse_args(arguments)
    folder = options.data / "facades"
    sets = {
        "cmp": split_facades_for_training(list(read_dataset(CMP, folder / "cmp")))[1],
        "ecp": split_facades_for_training(list(read_dataset(ECP, folder / "ecp")))[1],
        "artdeco": read_dataset(ARTDECO, folder / "artdeco"),
    }
    result = {name: measure(facades, options.model) for name, facades in sets.items()}
    print(json.dumps({"benchmark": "elements", **result}))


if __name__ == "__main__":
    main()
