"""Scores of the shipped parser: `python -m benchmarks.parsing --data DIR` prints one JSON object.

ecp is the held-out fold of `catalogs.datasets.split` (void left out, chimneys as roof); artdeco, a set that the
parser never saw, measures transfer. seconds_per_image is the median wall time of `parse` on one core.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.datasets import LabelledFacade, artdeco, ecp, split
from facade_core.labels import CLASSES
from facade_core.parse import parse


def measure(facades: Iterable[LabelledFacade], *, model: Path | None = None) -> dict[str, Any]:
    """Parse each facade and score the pixels whose true class is known."""
    counts = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    seconds = []
    for facade in facades:
        start = time.perf_counter()
        labels = parse(facade.image, model=model).labels
        seconds.append(time.perf_counter() - start)
        counts += confusion(facade.labels, labels)
    return {**scores(counts), "images": len(seconds), "seconds_per_image": round(statistics.median(seconds), 3)}


def confusion(truth: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Pixels by true class (row) and parsed class (column); pixels without a true class are left out."""
    known = truth < len(CLASSES)
    pairs = truth[known].astype(np.intp) * len(CLASSES) + labels[known]
    return np.bincount(pairs, minlength=len(CLASSES) ** 2).reshape(len(CLASSES), len(CLASSES))


def scores(counts: np.ndarray) -> dict[str, Any]:
    """Pixel accuracy, mean class accuracy, mIoU and IoU per class; classes neither true nor parsed are left out."""
    hits, true, parsed = np.diag(counts), counts.sum(1), counts.sum(0)
    accuracy = hits[true > 0] / true[true > 0]
    shown = true + parsed > 0
    iou = hits[shown] / (true + parsed - hits)[shown]
    names = np.array(CLASSES)[shown]
    return {
        "pixel_accuracy": round(float(hits.sum() / counts.sum()), 4),
        "mean_class_accuracy": round(float(accuracy.mean()), 4),
        "mean_iou": round(float(iou.mean()), 4),
        "iou": {str(name): round(float(value), 4) for name, value in zip(names, iou, strict=True)},
    }


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Score the shipped parser on ECP (held-out fold) and Art-Deco.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/ecp, facades/artdeco",
    )
    parser.add_argument("--model", type=Path, help="another .onnx file, with its .json beside it")
    options = parser.parse_args(arguments)
    facades = options.data / "facades"
    _, held_out = split(list(ecp(facades / "ecp")))
    result = {
        "benchmark": "parsing",
        "ecp": measure(held_out, model=options.model),
        "artdeco": measure(artdeco(facades / "artdeco"), model=options.model),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
