"""Five folds: each facade completed by a model that never saw it, `python -m benchmarks.layout --folds DIR`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.layout.baselines import Method
from benchmarks.layout.figures import run
from catalogs.readers.layouts import LayoutRecord
from facade_core.facade.layout.model import LayoutModel, load_layout_model
from training.datasets.layouts import read_layouts, split_layouts_for_training
from training.layout import cases as training_cases
from training.layout.train import train_layout

FOLDS = 5
# The mean of five lies in so many of their standard errors with 95 %: Student's t of four degrees of freedom.
_STUDENT = 2.776
# What is no baseline.
OURS = ("complete", "complete, best of 5")

Methods = Callable[[LayoutModel, Sequence[LayoutRecord]], Mapping[str, Method]]


def by_fold(data: Path, models: Path, methods: Methods, *, seed: int = 1) -> dict[str, Any]:
    """Figures by method and kind over five folds, and of `complete` over the best baseline of each.

    models: where each fold's model is, or is trained first by `train_layout` on the other four folds. A figure is
    [mean, half its 95 % interval, lowest].
    """
    layouts = list(read_layouts(data / "layouts" / "cmp.jsonl"))
    found = []
    for fold in range(FOLDS):
        path = models / str(fold) / "layouts.json"
        if not path.exists():
            print(f"fold {fold}: trained", file=sys.stderr)
            train_layout(data, path.parent, seed=seed, fold=fold)
        model = load_layout_model(path)
        train, held_out = split_layouts_for_training(layouts, fold)
        if set(model.training_set) & {record.name for record in held_out}:
            raise SystemExit(f"{path}: learned from facades of fold {fold}; remove it")
        found.append({name: run(held_out, method) for name, method in methods(model, train).items()})
        print(f"fold {fold}: {found[-1]['complete']['all']}", file=sys.stderr)
    kinds = (*training_cases.BENCHMARK_KINDS, "all")
    report: dict[str, Any] = {
        name: {kind: _interval([fold[name][kind]["f1@0.5"] for fold in found]) for kind in kinds} for name in found[0]
    }
    for name in OURS:
        labels = found[0][name]["all"]["by label"]
        report[name]["by label"] = {
            label: _interval([fold[name]["all"]["by label"][label] for fold in found]) for label in labels
        }
        report[name]["count"] = {
            kind: _interval([fold[name][kind]["count"] for fold in found]) for kind in training_cases.BENCHMARK_KINDS
        }
        report[name]["cpu seconds a case"] = _interval([fold[name]["right"]["cpu seconds a case"] for fold in found])
    report["complete over the best baseline"] = {
        kind: _interval(
            [
                fold["complete"][kind]["f1@0.5"]
                / max(figures[kind]["f1@0.5"] for name, figures in fold.items() if name not in OURS)
                for fold in found
            ]
        )
        for kind in kinds
    }
    report["best of 5 over complete"] = {
        kind: _interval([fold[OURS[1]][kind]["f1@0.5"] / fold[OURS[0]][kind]["f1@0.5"] for fold in found])
        for kind in kinds
    }
    return report


def _interval(values: Sequence[float]) -> list[float]:
    half = _STUDENT * np.std(values, ddof=1) / len(values) ** 0.5
    return [round(float(v), 3) for v in (np.mean(values), half, min(values))]
