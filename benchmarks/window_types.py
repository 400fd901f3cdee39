"""Types of windows against what was planted or told by eye: adjusted Rand index of windows of one size group and its types."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.labelled_facades import elements_of, facades
from facade_core.core.types import Element
from facade_core.facade.variation.group_patches import cut_group_patches
from facade_core.facade.variation.variations import clip_to_image, find_variations
from facade_core.facade.variation.window_types import compare_windows

# What windows of 20 ECP facades show, told by eye.
STATES = Path(__file__).with_name("window_states.json")
# Painted facades from this seed on were not looked at when weights and thresholds of the types were chosen.
UNSEEN = 11


class Told(NamedTuple):
    """Of the windows of a facade whose state is known: the size group, the state, and the type found."""

    group: list[int]
    state: list[str]
    type: list[int]


def told(image: np.ndarray, elements: Sequence[Element], states: Mapping[int, str]) -> Told:
    """Of the elements whose state is known by their index."""
    of = find_variations(image, elements)
    boxes = np.concatenate([g.boxes for g in of.groups])
    labels = np.repeat([g.label for g in of.groups], [len(g.boxes) for g in of.groups])
    group = np.repeat(np.arange(len(of.groups)), [len(g.boxes) for g in of.groups])
    found = Told([], [], [])
    for index, state in states.items():
        e = elements[index]
        apart = np.abs(boxes - (e.x0, e.y0, e.x1, e.y1)).sum(axis=1) + 1e6 * (labels != e.label)
        nearest = int(apart.argmin())
        found.group.append(int(group[nearest]))
        found.state.append(state)
        found.type.append(int(of.types[nearest]))
    return found


class Pairs(NamedTuple):
    """Pairs of windows of one size group: how alike they are, and whether their states are the same."""

    alike: list[float]
    same: list[bool]

    def area(self) -> float:
        """Area under the curve: how often a pair of one state is more alike than a pair of two."""
        from sklearn.metrics import roc_auc_score

        return round(float(roc_auc_score(self.same, self.alike)), 3)


def compare_pairs(pairs: Pairs, image: np.ndarray, elements: Sequence[Element], states: Mapping[int, str]) -> None:
    """Add the pairs of the windows whose state is known by their index."""
    kept = clip_to_image(elements, image.shape[:2])
    known = {
        (round(e.x0), round(e.y0), round(e.x1), round(e.y1)): states[i] for i, e in enumerate(elements) if i in states
    }
    for group in cut_group_patches(image, kept):
        if kept[group.members[0]].label != "window":
            continue
        alike, _, _ = compare_windows(group)
        boxes = [(int(e.x0), int(e.y0), int(e.x1), int(e.y1)) for e in (kept[i] for i in group.members)]
        told = [i for i, box in enumerate(boxes) if box in known]
        for one, other in combinations(told, 2):
            pairs.alike.append(float(alike[one, other]))
            pairs.same.append(known[boxes[one]] == known[boxes[other]])


def score(found: Told, *, groups: bool) -> float:
    """Adjusted Rand index of types and states; groups: windows of two sizes are two by truth, whatever they show."""
    from sklearn.metrics import adjusted_rand_score

    truth = [f"{g} {s}" for g, s in zip(found.group, found.state, strict=True)] if groups else found.state
    return float(adjusted_rand_score(truth, found.type))


def planted(seeds: int = 3) -> dict[str, object]:
    """Of windows of painted facades, with the states that were planted."""
    from benchmarks.painter.facade import paint_facade
    from benchmarks.painter.styles import STYLES

    found: dict[str, list[float]] = {}
    pairs = Pairs([], [])
    for seed in range(UNSEEN, UNSEEN + seeds):
        for style in STYLES:
            painted = paint_facade((18.0, 16.0), floors=5, columns=6, style=style, metres_per_pixel=0.04, seed=seed)
            known = {
                i: state
                for i, (e, state) in enumerate(zip(painted.elements, painted.element_states, strict=True))
                if e.label == "window"
            }
            found.setdefault(style, []).append(score(told(painted.image, painted.elements, known), groups=False))
            compare_pairs(pairs, painted.image, painted.elements, known)
    return _figures([one for of_style in found.values() for one in of_style]) | {
        "pairs: area under the curve": pairs.area(),
        "by style": {style: [round(s, 3) for s in of_style] for style, of_style in found.items()},
    }


def labelled(folder: Path) -> dict[str, object]:
    """Of windows of ECP facades, with the states told by eye in `window_states.json`. Windows of different size groups are of
    different types by construction, so that the index is told for each group and over all."""
    known = json.loads(STATES.read_text())["windows"]
    within, over, alone, pairs = {}, {}, [], Pairs([], [])
    for name, image, labels in facades(folder, 1):
        if name not in known:
            continue
        elements = elements_of(labels)
        state = {tuple(box): what for *box, what in known[name]}
        index = {
            i: state[box]
            for i, e in enumerate(elements)
            if e.label == "window" and (box := (int(e.x0), int(e.y0), int(e.x1), int(e.y1))) in state
        }
        found = told(image, elements, index)
        compare_pairs(pairs, image, elements, index)
        within[name], over[name] = score(found, groups=True), score(found, groups=False)
        alone.append(score(found._replace(type=found.group), groups=True))
    return _figures(list(within.values())) | {
        "windows": sum(len(windows) for windows in known.values()),
        "pairs: area under the curve": pairs.area(),
        "one type a size group: adjusted rand, median": round(float(np.median(alone)), 3),
        "across size groups: adjusted rand, median": round(float(np.median(list(over.values()))), 3),
        "by facade": {name: round(one, 3) for name, one in within.items()},
    }


def _figures(scores: Sequence[float]) -> dict[str, object]:
    return {
        "adjusted rand, median": round(float(np.median(scores)), 3),
        "adjusted rand, mean": round(float(np.mean(scores)), 3),
        "share at least 0.9": round(float(np.mean([s >= 0.9 for s in scores])), 3),
    }


def main() -> None:
    """Print the figures of painted and of labelled windows."""
    arguments = argparse.ArgumentParser(description=main.__doc__)
    arguments.add_argument("--data", type=Path, required=True, help="folder that holds facades/")
    given = arguments.parse_args()
    report = {"painted facades": planted(), "labelled windows": labelled(given.data / "facades" / "ecp")}
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
