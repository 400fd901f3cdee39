"""Layout completion on hidden parts of real facades that the model never saw: `python -m benchmarks.layout` prints JSON.

Cases are made from every fifth layout of layouts/cmp.jsonl, those the model does not name as trained on: right or lower half
hidden, a rectangle of 30-50 % hidden, or 25-35 % of the elements seen. F1 counts hidden elements found (one to one, same
label, IoU 0.5 or 0.3) over all cases. spacing: how far the median column spacing of the windows is off (share); alignment:
distance of a proposed window to the nearest true column (window widths, at most 1); count: |proposed - hidden| / hidden;
floors right: share of the cases whose number of floors is the true one; overlaps and outside are counts. The baselines run on
the same cases; `policy search` is the paper's method alone. mean f1 is over cases; --other-kinds hides the middle, a corner,
several holes, 70 % or trees. --ablation leaves out each score of the paper's search; --training-size learns their weights
from fewer facades; --paper runs that search and `complete`. --painted completes painted facades with a tree and a car, whose
truth is known. --sheet FILE draws forty completions, ten of each kind. --pairs DIR draws fifty facades beside their
completions, shuffled, with answers.csv and key.json for `streetloom bench blind_pairs --answers FILE --key FILE`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.layout.baselines import extension, median_pitch, nearest_layout, ours
from benchmarks.layout.figures import f1, matches, run
from benchmarks.layout.paper_rows import ablation, weights_by_size
from benchmarks.layout.sheet import draw_pairs, sheet
from benchmarks.papers.completion import Method, annealing, low_rank, policy_search
from catalogs.readers.layouts import LayoutRecord
from facade_core.facade.layout.grid_extension import ExtensionVariant
from facade_core.facade.layout.model import SHIPPED_LAYOUT_MODEL, LayoutModel, load_layout_model
from training.datasets.layouts import read_layouts
from training.layout import cases as training_cases


def held_out(path: Path, model: LayoutModel) -> list[LayoutRecord]:
    """The layouts of a file that the model did not learn from."""
    return [record for record in read_layouts(path) if record.name not in model.training_set]


PAINTED = tuple(itertools.product(("brick", "haussmann", "jugend"), (5, 7)))


def painted(which: Sequence[tuple[str, int]] = PAINTED) -> dict[str, Any]:
    """Painted facades by style and seed, with a tree and a car: the share of the hidden texels that get the label of the truth;
    elements of the completed layout that a parse of the finished picture finds again, F1 at IoU 0.5, of all and of those that
    a hole touches; of the true elements that a hole hides in part those that the parse finds, and their number."""
    from benchmarks.painter.facade import paint_facade
    from facade_core.facade.evidence import Evidence
    from facade_core.facade.photo_facade import MappedDoors, build_facade_from_photo
    from facade_core.parsing.confidence import box_coverage

    texels, counts = {}, np.zeros((3, 3))
    for style, seed in which:
        truth = paint_facade(
            (13.0, 14.0), floors=4, columns=4, style=style, metres_per_pixel=0.06, seed=seed, occluders=2
        )
        seen = Evidence(image=truth.image, hidden=truth.occluded, is_clean=True)
        made = build_facade_from_photo(seen, doors=MappedDoors(front=True), seed=1)
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
    parser.add_argument("--painted", action="store_true")
    parser.add_argument("--grids", action="store_true", help="complete, once, and the grid extensions only")
    parser.add_argument("--other-kinds", action="store_true", help="middle, corner, holes, most and trees hidden")
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
    model = load_layout_model(options.model)
    path = options.data / "layouts" / "cmp.jsonl"
    records = held_out(path, model)[:: options.every]
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
    elif options.painted:
        report["painted"] = painted()
    else:
        methods = methods_of(model, train)
        names = GRID_METHODS if options.grids else tuple(methods)
        report.update({name: run(records, methods[name], kinds) for name in names})
    print(json.dumps(report, indent=1))
