"""Changes of facades told from two captures: `python -m benchmarks.changes --data DIR` prints one JSON object.

made: the 17 held-out facades of ecp, each taken twice as `benchmarks.changes.pairs` does it (exposure, white balance, shadow,
panes that mirror, poses up to 0.25 m and corners 0.06 m off, resolution, noise, JPEG, trees and cars), three times with nothing
changed between and once with each kind of change. By kind: true, the share of what both show that changed, and told, means;
off, the mean difference of these; at 0.3: found, of the pairs in which 0.3 or more changed, told to be above 0.3; alarms, of
those in which nothing did. auc: nothing against each kind, by the score alone. cells: precision and recall of changed places.

`--fit` prints the weights of `facade_core.imagery.rectify.change_detection`, fitted on 40 of the other facades of ecp.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.changes.pairs import KINDS, Pair, pair_of
from facade_core.imagery.rectify.change_detection import change_cues, detect_changes
from training.datasets.facades import ECP, LabelledFacade, read_dataset, split_facades_for_training

FITTED, UNCHANGED = 40, 3
AT = 0.3


def pairs(facades: Sequence[LabelledFacade], others: Sequence[LabelledFacade], seed: int) -> Iterator[tuple[str, Pair]]:
    """Pairs of each facade, by kind of change."""
    for number, facade in enumerate(facades):
        for turn, kind in enumerate(("nothing",) * (UNCHANGED - 1) + KINDS):
            yield kind, pair_of(facade, others, kind, np.random.default_rng([seed, number, turn]))


def fit(data: Path) -> list[float]:
    """The weights of the regression, the constant first."""
    import cv2
    from sklearn.linear_model import LogisticRegression

    facades, _ = split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))
    cues, changed = [], []
    for _, pair in pairs(facades[:FITTED], facades[FITTED:], 0):
        found, both = change_cues(pair.newer, pair.older, pair.density)
        share = cv2.resize(pair.changed.astype(np.float32), both.shape[::-1], interpolation=cv2.INTER_AREA)
        clear = np.flatnonzero(both & ((share < 0.02) | (share > 0.98)))[::7]
        cues.append(found.reshape(-1, found.shape[2])[clear])
        changed.append(share.ravel()[clear] > 0.5)
    model = LogisticRegression(max_iter=500).fit(np.concatenate(cues), np.concatenate(changed))
    return [round(float(w), 3) for w in (model.intercept_[0], *model.coef_[0])]


def measure(made: Iterator[tuple[str, Pair]]) -> dict[str, Any]:
    """Figures of pairs."""
    from sklearn.metrics import roc_auc_score

    rows: dict[str, list[tuple[float, float]]] = {}
    cells = np.zeros(3)
    for kind, pair in made:
        told, both = detect_changes(pair.newer, pair.older, pair.density), pair.newer.clear & pair.older.clear
        if told.changed_share is None:
            continue
        rows.setdefault(kind, []).append((float((pair.changed & both).sum() / both.sum()), told.changed_share))
        mine, true = told.is_changed & both, pair.changed & both
        cells += [(mine & true).sum(), mine.sum(), true.sum()]
    of = {kind: np.array(values) for kind, values in rows.items()}
    nothing = of["nothing"][:, 1]
    found = np.concatenate([values for kind, values in of.items() if kind != "nothing"])
    auc = {
        kind: round(float(roc_auc_score([0] * len(nothing) + [1] * len(v), [*nothing, *v[:, 1]])), 3)
        for kind, v in of.items()
        if kind != "nothing"
    }
    much = found[found[:, 0] >= AT]
    return {
        "pairs": sum(map(len, of.values())),
        "kinds": {
            kind: {
                "true": round(float(v[:, 0].mean()), 3),
                "told": round(float(v[:, 1].mean()), 3),
                "off": round(float(np.abs(v[:, 0] - v[:, 1]).mean()), 3),
            }
            for kind, v in of.items()
        },
        "auc": auc,
        "at 0.3": {
            "found": [int((much[:, 1] > AT).sum()), len(much)],
            "alarms": [int((nothing > AT).sum()), len(nothing)],
        },
        "nothing, told at most": round(float(nothing.max()), 3),
        "cells": {"precision": round(cells[0] / cells[1], 3), "recall": round(cells[0] / cells[2], 3)},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Changes of facades told from two captures.")
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--fit", action="store_true", help="print the weights that other facades give")
    parser.add_argument("--only", choices=("made",), help="the one part there is")
    options = parser.parse_args()
    if options.fit:
        print(json.dumps(fit(options.data)))
        return
    result: dict[str, Any] = {"benchmark": "changes"}
    others, held_out = split_facades_for_training(list(read_dataset(ECP, options.data / "facades" / "ecp")))
    result["made"] = measure(pairs(held_out, others, 1))
    print(json.dumps(result))


if __name__ == "__main__":
    main()
