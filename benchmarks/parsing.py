"""Scores of a parser: `python -m benchmarks.parsing --data DIR` prints one JSON object.

Each set is measured on the facades that the model's .json does not name as trained on: the shipped model's ecp figures
are those of the held-out fold of `catalogs.datasets.split`, artdeco and ruemonge2014 (the authors' validation part)
measure transfer. Void is left out, chimneys are roof. seconds_per_image is the median wall time of `parse`.
elements compares the boxes of `elements` in the parse and in the true labels, one to one at IoU 0.5 or more.
occluders is measured on street photos of labelmefacade: vegetation and vehicles against all else that is labelled.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.datasets import ARTDECO, ECP, LABELMEFACADE, RUEMONGE, LabelledFacade, read
from facade_core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN
from facade_core.parse import elements, parse
from facade_core.parse.model_file import read_record
from facade_core.parse.regularity import regularise
from facade_core.parse.segmenter import SHIPPED, parse_with
from facade_core.types import Element

SETS = {
    "ecp": (ECP, "facades/ecp"),
    "artdeco": (ARTDECO, "facades/artdeco"),
    "ruemonge2014": (RUEMONGE, "facades/ruemonge2014/val"),
}
_LEAST_OVERLAP = 0.5


def measure(facades: Iterable[LabelledFacade], *, model: Path | None = None, regular: bool = True) -> dict[str, Any]:
    """Parse each facade, with the last step that makes it regular or without; score the pixels whose true class is
    known, and the elements."""
    counts = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    boxes: Counter[tuple[str, str]] = Counter()
    seconds = []
    for facade in facades:
        start = time.perf_counter()
        labels = parse_with(facade.image, model, regularise if regular else lambda confidence: confidence).labels
        seconds.append(time.perf_counter() - start)
        counts += confusion(facade.labels, labels)
        boxes += matches(elements(facade.labels), elements(np.where(facade.labels == UNKNOWN, UNKNOWN, labels)))
    return {
        **scores(counts),
        "elements": {name: f1(boxes, name) for name in ELEMENT_CLASSES},
        "images": len(seconds),
        "seconds_per_image": round(statistics.median(seconds), 3),
    }


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


def matches(true: Sequence[Element], found: Sequence[Element]) -> Counter[tuple[str, str]]:
    """How many elements of a class are (class, "true"), (class, "found") and (class, "both"): paired one to one for
    the greatest sum of IoU, where it is at least 0.5."""
    from scipy.optimize import linear_sum_assignment

    counts: Counter[tuple[str, str]] = Counter()
    for name in ELEMENT_CLASSES:
        one, other = (
            np.array([(e.x0, e.y0, e.x1, e.y1) for e in boxes if e.label == name]).reshape(-1, 4)
            for boxes in (true, found)
        )
        overlap = _overlaps(one, other)
        overlap[overlap < _LEAST_OVERLAP] = 0
        rows, columns = linear_sum_assignment(overlap, maximize=True)
        counts[name, "true"], counts[name, "found"] = len(one), len(other)
        counts[name, "both"] = int(np.count_nonzero(overlap[rows, columns]))
    return counts


def f1(counts: Counter[tuple[str, str]], name: str) -> float | None:
    """F1 of a class; None where there is none, true or found."""
    both = counts[name, "true"] + counts[name, "found"]
    return round(2 * counts[name, "both"] / both, 4) if both else None


def measure_occluders(photos: Iterable[LabelledFacade], *, model: Path | None = None) -> dict[str, Any]:
    """IoU, precision and recall of the occluded pixels, over all photos together."""
    both = found = true = images = 0
    for photo in photos:
        known = photo.occluder != UNKNOWN
        truth, seen = photo.occluder[known] == 1, parse(photo.image, model=model).occluded[known]
        both += int((truth & seen).sum())
        found, true, images = found + int(seen.sum()), true + int(truth.sum()), images + 1
    return {
        "iou": round(both / max(1, true + found - both), 4),
        "precision": round(both / max(1, found), 4),
        "recall": round(both / max(1, true), 4),
        "images": images,
    }


def unseen(facades: Iterable[LabelledFacade], name: str, model: Path | None) -> Iterator[LabelledFacade]:
    """The facades of a set that the model was not trained on."""
    trained_on = set(read_record(model or SHIPPED).get("training_set", []))
    return (facade for facade in facades if f"{name}/{facade.name}" not in trained_on)


def seconds_of_a_large_facade(model: Path | None) -> float:
    """Wall time of `parse` for 1000 x 700 pixels, the model loaded."""
    image = np.random.default_rng(0).integers(0, 256, (700, 1000, 3), dtype=np.uint8)
    times = []
    for _ in range(4):
        start = time.perf_counter()
        parse(image, model=model)
        times.append(time.perf_counter() - start)
    return round(statistics.median(times[1:]), 3)


def _overlaps(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """IoU of every box (x0, y0, x1, y1) with every other: (n, 4), (m, 4) -> (n, m)."""
    low = np.maximum(one[:, None, :2], other[None, :, :2])
    high = np.minimum(one[:, None, 2:], other[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(2)
    areas = [(boxes[:, 2:] - boxes[:, :2]).prod(1) for boxes in (one, other)]
    return shared / np.maximum(areas[0][:, None] + areas[1][None] - shared, 1e-9)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Score a parser on facades that it was not trained on.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/ and streetphotos/",
    )
    parser.add_argument("--model", type=Path, help="another .onnx file, with its .json beside it")
    parser.add_argument("--sets", nargs="*", choices=[*SETS, "labelmefacade"], help="all without it")
    parser.add_argument(
        "--ablation", action="store_true", help="measure too without the step that makes parses regular"
    )
    options = parser.parse_args(arguments)
    chosen = options.sets or [*SETS, "labelmefacade"]
    result: dict[str, Any] = {"benchmark": "parsing", "model": (options.model or SHIPPED).name}
    for name in chosen:
        if name in SETS:
            recipe, folder = SETS[name]
            result[name] = measure(
                unseen(read(recipe, options.data / folder), name, options.model), model=options.model
            )
        else:
            photos = read(LABELMEFACADE, options.data / "streetphotos" / "labelmefacade")
            result["occluders"] = measure_occluders(photos, model=options.model)
    result["seconds_1000x700"] = seconds_of_a_large_facade(options.model)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
