"""Layout completion on hidden parts of real facades that the model never saw: `python -m benchmarks.layout` prints JSON.

Cases are made from every fifth layout of layouts/cmp.jsonl, those the model does not name as trained on: right or lower half
hidden, a rectangle of 30-50 % hidden, or 25-35 % of the elements seen. F1 counts hidden elements found (one to one, same
label, IoU 0.5 or 0.3) over all cases. spacing: how far the median column spacing of the windows is off (share); alignment:
distance of a proposed window to the nearest true column (window widths, at most 1); count: |proposed - hidden| / hidden;
floors right: share of the cases whose number of floors is the true one; overlaps and outside are counts. The baselines run on
the same cases; `policy search` is the paper's method alone. mean f1 is over cases; --other-kinds hides the middle, a corner,
several holes, 70 % or trees; --layouts completes another set of the data; --only-complete leaves out the baselines. --ablation
leaves out each score of the paper's search; --training-size learns their weights from fewer facades; --paper runs that search
and `complete`. --regularity has the facades in two halves, by the share of the cells of all rows and columns of windows that
hold one; --plausibility asks a classifier which is real; --places says what became of hidden windows; --painted completes
painted facades with a tree and a car, whose truth is known; --speed times 10,000 candidates of the policy search. --folds DIR
trains a model on each four of five folds and has all methods on the fifth: means, half their 95 % intervals, and the lowest of
five. --sheet FILE draws forty completions, ten of each kind. --pairs DIR draws fifty facades beside their completions,
shuffled, with answers.csv and key.json for `streetloom bench blind_pairs --answers FILE --key FILE`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.layout.baselines import (
    Method,
    annealing,
    extension,
    low_rank,
    median_pitch,
    nearest_layout,
    ours,
    policy_search,
)
from benchmarks.layout.figures import f1, matches, run
from benchmarks.layout.folds import by_fold
from benchmarks.layout.paper_rows import ablation, weights_by_size
from benchmarks.layout.sheet import draw_pairs, sheet
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.facade.layout.facade_frame import fit_columns_and_floors
from facade_core.facade.layout.grid_extension import ExtensionVariant
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.model import SHIPPED_LAYOUT_MODEL, LayoutModel, load_layout_model
from facade_core.facade.layout.policy_optimisation import evolve_policy_candidates, observed_layout_arrays
from facade_core.facade.layout.proposals import propose_elements
from facade_core.facade.layout.rectangles import WINDOW, pairwise_iou
from facade_core.facade.layout.scores import layout_score_terms
from training.datasets.layouts import read_layouts
from training.layout import cases as training_cases


def held_out(path: Path, model: LayoutModel) -> list[LayoutRecord]:
    """The layouts of a file that the model did not learn from."""
    return [record for record in read_layouts(path) if record.name not in model.training_set]


def plausibility(
    records: Sequence[LayoutRecord], methods: dict[str, Method], model: LayoutModel
) -> dict[str, dict[str, float]]:
    """How completed layouts (right half hidden) differ from real ones, by held-out facades.

    told apart: how often one fixed classifier knows which of two, the real one and the completed one, is real (.5: it guesses);
    whole: cells that hold a window, of all rows and columns of windows, in the completed half; real: the same of the truth.
    """
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.model_selection import GroupKFold, cross_val_predict

    found: dict[str, dict[str, float]] = {}
    for name, method in methods.items():
        rows, real, group = [], [], []
        filled: dict[bool, list[float]] = {True: [], False: []}
        for i, record in enumerate(records):
            elements, domain = list(record.elements), record.domain
            seen, region = training_cases.hide_part("right", elements, domain, np.random.default_rng([0, i]))
            if not seen or len(seen) == len(elements):
                continue
            for layout, truth in ((elements, True), ([*seen, *method(seen, domain, region)[0]], False)):
                labels = [e.label for e in layout]
                share = [labels.count(label) / len(labels) for label in ELEMENT_CLASSES]
                rows.append([*layout_score_terms(layout, domain, model), *share])
                hidden = [e for e in layout if e.label == "window" and e.x0 >= region[0][2]]
                if hidden:
                    lines = fit_columns_and_floors(hidden, domain)
                    filled[truth].append(len(hidden) / max(len(lines.columns) * len(lines.floors), 1))
                real.append(truth)
                group.append(i)
        forest = RandomForestClassifier(200, min_samples_leaf=3, random_state=0)
        likely = cross_val_predict(
            forest, np.array(rows), np.array(real), groups=group, cv=GroupKFold(5), method="predict_proba"
        )[:, 1].reshape(-1, 2)
        right = (likely[:, 0] > likely[:, 1]) + 0.5 * (likely[:, 0] == likely[:, 1])
        found[name] = {
            "told apart": round(float(right.mean()), 3),
            "whole": round(float(np.mean(filled[False])), 3),
            "real": round(float(np.mean(filled[True])), 3),
        }
    return found


def by_regularity(records: Sequence[LayoutRecord], model: LayoutModel) -> dict[str, Any]:
    """The figures of `complete` and of grid extension on the more and the less regular half of the facades."""
    regular = []
    for record in records:
        lines = fit_columns_and_floors(record.elements, record.domain)
        windows = sum(e.label == "window" for e in record.elements)
        regular.append(windows / max(len(lines.columns) * len(lines.floors), 1))
    middle = float(np.median(regular))
    halves = {
        "regular": [r for r, share in zip(records, regular, strict=True) if share >= middle],
        "irregular": [r for r, share in zip(records, regular, strict=True) if share < middle],
    }
    methods = {"complete": ours(model, 1), "grid extension by median pitch": median_pitch}
    return {
        "cells that hold a window, median": round(middle, 3),
        **{half: {name: run(of, method)["all"] for name, method in methods.items()} for half, of in halves.items()},
    }


def places(records: Sequence[LayoutRecord], model: LayoutModel) -> dict[str, dict[str, float]]:
    """By kind, the shares of hidden windows that are found (IoU 0.5), that have one beside their place (0.15), for which one
    was proposed and not picked, and for which none was."""
    found: dict[str, dict[str, float]] = {}
    for kind in training_cases.BENCHMARK_KINDS:
        counts = np.zeros(4)
        for i, record in enumerate(records):
            elements, domain = list(record.elements), record.domain
            seen, region = training_cases.hide_part(kind, elements, domain, np.random.default_rng([0, i]))
            hidden = box_array([e for e in elements if e not in set(seen) and e.label == "window"])
            if not seen or not len(hidden):
                continue
            visible = np.array(region, float).reshape(-1, 4)
            guesses = propose_elements(seen, fit_grids(seen), domain, visible, model.priors)
            made = box_array([e for e in ours(model, 1)(seen, domain, region)[0] if e.label == "window"])
            near = pairwise_iou(hidden, made).max(axis=1, initial=0.0)
            proposed = pairwise_iou(hidden, guesses.box[guesses.label == WINDOW]).max(axis=1, initial=0.0) >= 0.5
            right, beside = near >= 0.5, (near >= 0.15) & (near < 0.5)
            none = ~right & ~beside
            counts += np.sum([right, beside, none & proposed, none & ~proposed], axis=1)
        names = ("found", "beside", "proposed", "not proposed")
        found[kind] = dict(zip(names, (counts / counts.sum()).round(3).tolist(), strict=True))
    return found


PAINTED = tuple(itertools.product(("brick", "haussmann", "jugend"), (5, 7)))


def painted(which: Sequence[tuple[str, int]] = PAINTED) -> dict[str, Any]:
    """Painted facades by style and seed, with a tree and a car: the share of the hidden texels that get the label of the truth;
    elements of the completed layout that a parse of the finished picture finds again, F1 at IoU 0.5, of all and of those that
    a hole touches; of the true elements that a hole hides in part those that the parse finds, and their number."""
    from benchmarks.painter.facade import paint_facade
    from facade_core.facade.photo_facade import MappedDoors, PhotoMasks, build_facade_from_photo
    from facade_core.parsing.confidence import box_coverage

    texels, counts = {}, np.zeros((3, 3))
    for style, seed in which:
        truth = paint_facade(
            (13.0, 14.0), floors=4, columns=4, style=style, metres_per_pixel=0.06, seed=seed, occluders=2
        )
        masks, doors = PhotoMasks(is_clean=True), MappedDoors(front=True)
        made = build_facade_from_photo(truth.image, truth.occluded, masks=masks, doors=doors, seed=1)
        assert made.completion is not None
        texels[f"{style} {seed}"] = round(float((made.labels == truth.labels)[truth.occluded].mean()), 3)
        layout, again = made.completion.elements, made.elements
        touched = [[e for e in of if box_coverage(truth.occluded, e) > 0.02] for of in (layout, again)]
        cut = [e for e in truth.elements if 0.05 < box_coverage(truth.occluded, e) < 0.95]
        pairs = ((layout, again), (touched[0], touched[1]), (cut, again))
        counts += [matches(wanted, got, 0.5).sum(axis=0) for wanted, got in pairs]
    return {
        "texels": texels | {"mean": round(float(np.mean(list(texels.values()))), 3)},
        "found again": {"all": f1(counts[0]), "touched by a hole": f1(counts[1])},
        "hidden in part": {"kept": int(counts[2, 0]), "of": int(counts[2, 2])},
    }


def speed(records: Sequence[LayoutRecord], model: LayoutModel) -> dict[str, float]:
    """CPU seconds for 10,000 candidates, right half hidden: median and largest over a few facades."""
    seconds = []
    for record in records[:7]:
        seen, region = training_cases.hide_part("right", record.elements, record.domain, np.random.default_rng(0))
        start = observed_layout_arrays(seen, record.domain, np.array(region), model)
        evolve_policy_candidates(model.policies, start, model, 1, 1, 0)
        begin = time.process_time()
        evolve_policy_candidates(model.policies, start, model, 10, 10, 0)
        seconds.append(10 * (time.process_time() - begin))
    return {"median": round(float(np.median(seconds)), 2), "largest": round(max(seconds), 2)}


# The method and the baselines that extend grids, which are the best.
GRID_METHODS = (
    "complete",
    "grid extension by median pitch",
    "grid extension, balanced",
    "mirror and extension",
)


def methods_of(model: LayoutModel, train: Sequence[LayoutRecord]) -> dict[str, Method]:
    """Completion and all that it is measured against, by a model and the layouts that it learned from."""
    return {
        "complete": ours(model, 1),
        "complete, best of 5": ours(model, 5),
        "policy search": policy_search(model),
        "grid extension by median pitch": median_pitch,
        "grid extension, balanced": extension(ExtensionVariant(False, True, False, False)),
        "mirror and extension": extension(ExtensionVariant(True, False, False, False)),
        "nearest layout": nearest_layout(train),
        "low rank": low_rank,
        "simulated annealing": annealing(model),
    }


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(prog="benchmarks.layout", description=__doc__)
    data = os.environ.get("STREETLOOM_DATA", Path(__file__).resolve().parents[3] / "shared" / "data")
    parser.add_argument("--data", type=Path, default=data)
    parser.add_argument("--model", type=Path, default=SHIPPED_LAYOUT_MODEL)
    parser.add_argument("--every", type=int, default=1, help="only every so many of the held-out facades")
    parser.add_argument("--ablation", action="store_true")
    parser.add_argument("--training-size", action="store_true")
    parser.add_argument("--paper", action="store_true", help="the paper's search of 10,000 candidates, and complete")
    parser.add_argument("--plausibility", action="store_true")
    parser.add_argument("--regularity", action="store_true")
    parser.add_argument("--places", action="store_true")
    parser.add_argument("--painted", action="store_true")
    parser.add_argument("--speed", action="store_true")
    parser.add_argument("--only-complete", action="store_true")
    parser.add_argument("--grids", action="store_true", help="complete, once, and the grid extensions only")
    parser.add_argument("--other-kinds", action="store_true", help="middle, corner, holes, most and trees hidden")
    parser.add_argument("--layouts", default="cmp.jsonl", help="file in layouts/ of the data")
    parser.add_argument("--folds", type=Path, metavar="DIR", help="five folds; their models are kept there")
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="a picture of forty completions")
    parser.add_argument("--pairs", type=Path, metavar="DIR", help="fifty pairs of a true and a completed layout")
    options = parser.parse_args()
    if options.sheet or options.pairs:
        model = load_layout_model(options.model)
        records = held_out(options.data / "layouts" / "cmp.jsonl", model)
        if options.sheet:
            sheet(records, model, options.sheet)
        if options.pairs:
            draw_pairs(records, model, options.pairs)
        return
    if options.folds:
        print(json.dumps(by_fold(options.data, options.folds, methods_of), indent=1))
        return
    model = load_layout_model(options.model)
    path = options.data / "layouts" / "cmp.jsonl"
    records = held_out(options.data / "layouts" / options.layouts, model)[:: options.every]
    train = [record for record in read_layouts(path) if record.name in model.training_set]
    kinds = training_cases.OTHER_KINDS if options.other_kinds else training_cases.BENCHMARK_KINDS
    report: dict[str, Any] = {"model": options.model.name, "facades": len(records)}
    if options.ablation:
        report["ablation"] = ablation(records, model)
    elif options.training_size:
        report["weights by training size"] = weights_by_size(train, model)
    elif options.paper:
        methods = {"policy search": policy_search(model), "complete": ours(model, 1)}
        report.update({name: run(records, method, kinds) for name, method in methods.items()})
    elif options.plausibility:
        report["plausibility"] = plausibility(
            records, {"complete": ours(model, 1), "grid extension": median_pitch}, model
        )
    elif options.regularity:
        report["regularity"] = by_regularity(records, model)
    elif options.places:
        report["hidden windows"] = places(records, model)
    elif options.painted:
        report["painted"] = painted()
    elif options.speed:
        report["seconds for 10,000 candidates"] = speed(records, model)
    elif options.only_complete:
        report["complete"] = run(records, ours(model, 1), kinds)
    else:
        methods = methods_of(model, train)
        names = GRID_METHODS if options.grids else tuple(methods)
        report.update({name: run(records, methods[name], kinds) for name in names})
    print(json.dumps(report, indent=1))
