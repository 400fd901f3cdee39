"""What a parser takes for things in front of facades: is it there, and is it let be where there is nothing.

in_front.json holds boxes marked by eye of all cars, vans, motorcycles and people before the 17 held-out facades of ECP.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.painter.exemplars import paint_exemplar_set
from training.datasets.facades import ANY_CLASS, LabelledFacade
from training.parser.occluder_labels import ground_floor_rows

# A seed of painted facades that neither the training nor the demo paints.
PAINTED_SEED = 30_000
_PAINTED = 20
_FOUND = 0.5

Hidden = Callable[[np.ndarray], np.ndarray]


def marked() -> dict[str, list[tuple[int, int, int, int, str]]]:
    """Boxes (x0, y0, x1, y1, kind) in pixels, half-open, by the names of ECP's held-out facades."""
    return json.loads(Path(__file__).with_name("in_front.json").read_text(encoding="utf-8"))


def measure_things(
    facades: Iterable[LabelledFacade], boxes: Mapping[str, Sequence[tuple[int, int, int, int, str]]], hidden: Hidden
) -> dict[str, Any]:
    """How many marked things of each kind are found: at least half of the pixels of their box are told to be hidden.

    hidden: (H, W, 3) uint8 -> (H, W) bool, where something is seen in front. ground_floor is the share of the ground
    floors that is told to be hidden, in the boxes or not, beside_boxes the same of the columns that no box reaches into,
    where next to nothing is, and boxes the share of these floors that boxes cover.
    """
    found: Counter[str] = Counter()
    true: Counter[str] = Counter()
    seen, covered, floors, beside = 0, 0, 0, np.zeros(2, np.int64)
    for facade in facades:
        there = hidden(facade.image)
        inside = np.zeros(there.shape, bool)
        for x0, y0, x1, y1, kind in boxes.get(facade.name, ()):
            true[kind] += 1
            found[kind] += int(there[y0:y1, x0:x1].mean() >= _FOUND)
            inside[y0:y1, x0:x1] = True
        top, bottom = ground_floor_rows(facade.labels, facade.possible)
        seen, covered = seen + int(there[top:bottom].sum()), covered + int(inside[top:bottom].sum())
        floors += there[top:bottom].size
        free = there[top:bottom, ~inside.any(0)]
        beside += (int(free.sum()), free.size)
    vehicles = [kind for kind in true if kind != "person"]
    return {
        "recall": {kind: [found[kind], true[kind]] for kind in sorted(true)},
        "vehicles": [sum(found[kind] for kind in vehicles), sum(true[kind] for kind in vehicles)],
        "ground_floor": round(seen / max(1, floors), 4),
        "beside_boxes": round(float(beside[0] / max(1, beside[1])), 4),
        "boxes": round(covered / max(1, floors), 4),
    }


def false_masks(facades: Iterable[LabelledFacade], hidden: Hidden) -> dict[str, Any]:
    """The share told to be hidden of what is labelled above the ground floor, where next to nothing is in front: the mean
    of the facades, their highest, and how many of them lose more than a twentieth."""
    shares = []
    for facade in facades:
        upper = np.zeros(facade.labels.shape, bool)
        upper[: ground_floor_rows(facade.labels, facade.possible)[0]] = True
        upper &= facade.possible != ANY_CLASS
        if upper.any():
            shares.append(float(hidden(facade.image)[upper].mean()))
    return _shares(shares)


def false_masks_painted(hidden: Hidden) -> dict[str, Any]:
    """The same of the whole of painted facades, which nothing stands in front of."""
    return _shares([float(hidden(painted.image).mean()) for painted in paint_exemplar_set(_PAINTED, seed=PAINTED_SEED)])


def _shares(shares: Sequence[float]) -> dict[str, Any]:
    return {
        "mean": round(float(np.mean(shares)), 4),
        "highest": round(max(shares), 4),
        "above_0.05": sum(share > 0.05 for share in shares),
        "images": len(shares),
    }
