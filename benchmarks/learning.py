"""What fifty corrected facades bring on a city's others: `python -m benchmarks.learning --data DIR` prints one JSON object.

A set of labelled facades that the shipped models never saw is a city that somebody corrects: fifty of its facades become
corrections (the boxes of windows, balconies, doors and shops alone, through the checks that `streetloom import` makes), the
models learn from them as `streetloom train parser --corrections` and `train layout --corrections` do, and the others are the
test, before and after. The sets' licences allow no shipped weights: what is trained here is for the measurement only.

parser (refused: no better on the corrected facades that it did not learn from, and not kept):
artdeco (50 corrected, 13 others) and ruemonge2014 (50 of its train part, its authors' val part of 106). Each figure is
[before, after, gain, low, high]: low and high bound the gain with 95 %, by 2000 resamplings of the test facades. kept is the
same on the 17 held-out facades of ecp, on which the shipped network was measured: what is forgotten for it.
layout: F1 at IoU 0.5 of hidden elements, as `benchmarks.layout` hides them, by `complete`; fifty of layouts/artdeco.jsonl are
corrected, 13 are the test.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.layout.baselines import ours
from benchmarks.layout.figures import matches as matched
from benchmarks.parsing import confusion, f1, matches, scores
from catalogs.block.corrections import Correction, validate_correction
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.errors import InputError
from facade_core.core.labels import UNKNOWN
from facade_core.facade.layout.model import SHIPPED_LAYOUT_MODEL as SHIPPED_LAYOUTS
from facade_core.facade.layout.model import load_layout_model
from facade_core.parsing.elements import elements
from facade_core.parsing.network import SHIPPED_NETWORK
from facade_core.parsing.segmenter import parse
from training.datasets.corrected_facades import CorrectedFacade
from training.datasets.facades import ARTDECO, ECP, RUEMONGE, LabelledFacade, read_dataset, split_facades_for_training
from training.datasets.layouts import read_layouts, split_layouts_for_training
from training.layout import cases as training_cases
from training.layout.train import train_layout
from training.parser.train import fine_tune_on_corrections

CORRECTED = 50
SETS = ("artdeco", "ruemonge2014")
_RESAMPLED = 2000


def city(data: Path, name: str) -> tuple[list[LabelledFacade], list[LabelledFacade]]:
    """The facades of a set that somebody corrects, and its others."""
    folder = data / "facades" / name
    if name == "artdeco":
        others, held_out = split_facades_for_training(list(read_dataset(ARTDECO, folder)))
        return others[:CORRECTED], held_out
    train = list(read_dataset(RUEMONGE, folder / "train"))
    return [train[k * len(train) // CORRECTED] for k in range(CORRECTED)], list(read_dataset(RUEMONGE, folder / "val"))


def corrected(name: str, facade: LabelledFacade) -> CorrectedFacade:
    """A labelled facade as somebody would correct it: by the boxes of its elements, where the set tells of it."""
    height, width = facade.labels.shape
    boxes = [
        (e.label, e.x0 / width, e.y0 / height, e.x1 / width, e.y1 / height)
        for e in elements(facade.labels)
        if e.width > 0 and e.height > 0
    ]
    said = validate_correction(Correction(facade.name, "elements", boxes)).value
    # of what the set does not tell nobody said that it is no element
    return CorrectedFacade(f"{name}/{facade.name}", facade.image, facade.labels != UNKNOWN, said)


def parsed(facades: Sequence[LabelledFacade], model: Path) -> list[tuple[np.ndarray, Counter[tuple[str, str]]]]:
    """By facade: pixels by true and parsed class, and elements true, found and both."""
    found = []
    for facade in facades:
        labels = parse(facade.image, model=model).labels
        boxes = matches(elements(facade.labels), elements(np.where(facade.labels == UNKNOWN, UNKNOWN, labels)))
        found.append((confusion(facade.labels, labels), boxes))
    return found


def gains(before: Sequence[Any], after: Sequence[Any], figures: Callable[[Sequence[Any]], Mapping[str, float]]) -> Any:
    """Figure -> [before, after, gain, low, high], by resampling what was measured before and after together."""
    rng = np.random.default_rng(0)
    first, last = figures(before), figures(after)
    drawn: dict[str, list[float]] = {name: [] for name in first}
    for _ in range(_RESAMPLED):
        chosen = rng.integers(len(before), size=len(before)).tolist()
        one, two = figures([before[k] for k in chosen]), figures([after[k] for k in chosen])
        for name, values in drawn.items():
            values.append(two[name] - one[name])
    return {
        name: [
            round(float(v), 4)
            for v in (first[name], last[name], last[name] - first[name], *np.quantile(drawn[name], (0.025, 0.975)))
        ]
        for name in first
    }


def parser_figures(found: Sequence[tuple[np.ndarray, Counter[tuple[str, str]]]]) -> dict[str, float]:
    boxes: Counter[tuple[str, str]] = Counter()
    for _, one in found:
        boxes += one
    told = scores(np.sum([counts for counts, _ in found], axis=0))
    return {
        "pixels": told["pixel_accuracy"],
        "mIoU": told["mean_iou"],
        **{f"{name} F1": f1(boxes, name) or 0.0 for name in ("window", "balcony", "door")},
    }


def of_parser(data: Path, out: Path, name: str, seed: int) -> dict[str, Any]:
    mine, others = city(data, name)
    start = time.process_time()
    try:
        model = fine_tune_on_corrections([corrected(name, facade) for facade in mine], out / "parser" / name, seed=seed)
    except InputError as error:
        return {"corrected": len(mine), "refused": str(error)}
    seconds = time.process_time() - start
    _, ecp = split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))
    return {
        "corrected": len(mine),
        "others": len(others),
        "cpu seconds": round(seconds),
        **gains(parsed(others, SHIPPED_NETWORK), parsed(others, model), parser_figures),
        "kept": gains(parsed(ecp, SHIPPED_NETWORK), parsed(ecp, model), parser_figures),
    }


def of_layout(data: Path, out: Path, seed: int) -> dict[str, Any]:
    mine, others = split_layouts_for_training(list(read_layouts(data / "layouts" / "artdeco.jsonl")))
    mine = mine[:CORRECTED]
    start = time.process_time()
    path = train_layout(data, out / "layout", seed=seed, corrected=mine)
    seconds = time.process_time() - start
    before, after = (completed(others, model) for model in (SHIPPED_LAYOUTS, path))
    return {
        "corrected": len(mine),
        "others": len(others),
        "cpu seconds": round(seconds),
        **gains(before, after, layout_figures),
    }


def completed(layouts: Sequence[LayoutRecord], path: Path) -> list[dict[str, np.ndarray]]:
    """By facade and kind of what is hidden: elements matched, proposed and true, (3,) each."""
    complete = ours(load_layout_model(path), 1)
    found = []
    for number, layout in enumerate(layouts):
        by_kind = {}
        for kind in training_cases.BENCHMARK_KINDS:
            seen, region = training_cases.hide_part(
                kind, layout.elements, layout.domain, np.random.default_rng([0, number])
            )
            hidden = [e for e in layout.elements if e not in set(seen)]
            if seen and hidden:
                by_kind[kind] = matched(hidden, complete(seen, layout.domain, region)[0], 0.5).sum(axis=0)
        found.append(by_kind)
    return found


def layout_figures(found: Sequence[Mapping[str, np.ndarray]]) -> dict[str, float]:
    by_kind = {
        kind: sum((one[kind] for one in found if kind in one), np.zeros(3)) for kind in training_cases.BENCHMARK_KINDS
    }
    by_kind["all"] = sum(by_kind.values(), np.zeros(3))
    return {kind: float(2 * n[0] / max(n[1] + n[2], 1)) for kind, n in by_kind.items()}


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Measure what fifty corrected facades bring on a city's others.")
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--out", type=Path, required=True, help="where the models that are trained go")
    parser.add_argument("--of", nargs="*", choices=("parser", "layout"), default=("parser", "layout"))
    parser.add_argument("--sets", nargs="*", choices=SETS, default=SETS, help="of the parser")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    result: dict[str, Any] = {"benchmark": "learning"}
    if "parser" in options.of:
        result["parser"] = {}
        for name in options.sets:
            result["parser"][name] = of_parser(options.data, options.out, name, options.seed)
            print(f"{name}: {result['parser'][name]}", file=sys.stderr)
    if "layout" in options.of:
        result["layout"] = of_layout(options.data, options.out, 1)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
