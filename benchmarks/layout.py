"""Layout completion on hidden parts of real facades: F1 at IoU 0.5 and 0.3 of the hidden elements, as JSON."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np

from facade_core.layout import complete
from facade_core.types import Element

LABELS = ("window", "balcony", "door", "shop")
Box = tuple[float, float, float, float]


def facades(path: Path) -> list[tuple[list[Element], Box]]:
    """The layouts of a file: elements inside the facade, and the facade's box (the union of its parts)."""
    found = []
    for line in path.read_text().splitlines():
        record = json.loads(line)
        things = [Element(o["label"], o["x0"], o["y0"], o["x1"], o["y1"]) for o in record["objects"]]
        walls = [e for e in things if e.label == "facade"] or [Element("", 0, 0, record["width"], record["height"])]
        x0, y0 = min(e.x0 for e in walls), min(e.y0 for e in walls)
        x1, y1 = max(e.x1 for e in walls), max(e.y1 for e in walls)
        inside = [
            e
            for e in dict.fromkeys(things)
            if e.label in LABELS and e.width > 0 and e.height > 0
            if x0 <= (e.x0 + e.x1) / 2 <= x1 and y0 <= (e.y0 + e.y1) / 2 <= y1
        ]
        found.append((inside, (x0, y0, x1, y1)))
    return found


def hide(kind: str, elements: list[Element], domain: Box, rng: np.random.Generator) -> tuple[list[Element], list[Box]]:
    """The elements that stay visible and the visible region, for one kind of case."""
    x0, y0, x1, y1 = domain
    if kind == "right":
        region = [(x0, y0, (x0 + x1) / 2, y1)]
    elif kind == "lower":
        region = [(x0, y0, x1, (y0 + y1) / 2)]
    elif kind == "region":
        share = rng.uniform(0.3, 0.5)
        w = rng.uniform(share, 1) ** 0.5
        h = share / w
        a, b = x0 + rng.uniform(0, 1 - w) * (x1 - x0), y0 + rng.uniform(0, 1 - h) * (y1 - y0)
        c, d = a + w * (x1 - x0), b + h * (y1 - y0)
        around = [(x0, y0, x1, b), (x0, d, x1, y1), (x0, b, a, d), (c, b, x1, d)]
        region = [r for r in around if r[0] < r[2] and r[1] < r[3]]
    else:
        count = max(1, round(rng.uniform(0.25, 0.35) * len(elements)))
        seen = [elements[i] for i in np.sort(rng.permutation(len(elements))[:count])]
        return seen, [(e.x0, e.y0, e.x1, e.y1) for e in seen]
    return [e for e in elements if any(_meets(e, r) for r in region)], region


def _meets(e: Element, r: Box) -> bool:
    return min(e.x1, r[2]) > max(e.x0, r[0]) and min(e.y1, r[3]) > max(e.y0, r[1])


def matches(truth: list[Element], proposed: list[Element], threshold: float) -> int:
    """How many pairs of one label reach the IoU threshold, each element in one pair at most."""
    from scipy.optimize import linear_sum_assignment

    if not truth or not proposed:
        return 0
    a, b = (np.array([(e.x0, e.y0, e.x1, e.y1) for e in s]) for s in (truth, proposed))
    sides = np.minimum(a[:, None, 2:], b[None, :, 2:]) - np.maximum(a[:, None, :2], b[None, :, :2])
    shared = np.clip(sides, 0, None).prod(axis=2)
    area_a, area_b = ((s[:, 2:] - s[:, :2]).prod(axis=1) for s in (a, b))
    iou = shared / (area_a[:, None] + area_b - shared)
    good = iou >= threshold
    return int(good[linear_sum_assignment(~good)].sum())


def run(path: Path, *, every: int = 1, n: int = 1, seed: int = 0) -> dict[str, object]:
    """F1 per kind of case and per label over the layouts of a file (best of n completions)."""
    report: dict[str, object] = {}
    layouts = facades(path)[::every]
    for kind in ("right", "lower", "region", "sparse"):
        counts = {(label, t): np.zeros(3) for label in LABELS for t in (0.5, 0.3)}
        start, cases = time.perf_counter(), 0
        for i, (elements, domain) in enumerate(layouts):
            seen, region = hide(kind, elements, domain, np.random.default_rng([seed, i]))
            hidden = [e for e in elements if e not in seen]
            if not seen or not hidden:
                continue
            cases += 1
            options = []
            for completion in complete(seen, domain, region, n=n):
                proposed = completion.elements[len(seen) :]
                option = {}
                for label, t in counts:
                    truth, guess = ([e for e in s if e.label == label] for s in (hidden, proposed))
                    option[label, t] = np.array([matches(truth, guess, t), len(guess), len(truth)])
                options.append(option)
            best = max(options, key=lambda o: f1(_total(o, 0.5)))
            for key, value in best.items():
                counts[key] += value
        figures = {f"f1@{t}": f1(_total(counts, t)) for t in (0.5, 0.3)}
        per_label = {label: f1(counts[label, 0.5]) for label in LABELS}
        seconds = (time.perf_counter() - start) / max(cases, 1)
        report[kind] = {"cases": cases, **figures, "f1@0.5 by label": per_label, "seconds per case": round(seconds, 4)}
    return report


def _total(counts: dict[tuple[str, float], np.ndarray], threshold: float) -> np.ndarray:
    return np.sum([counts[label, threshold] for label in LABELS], axis=0)


def f1(counts: np.ndarray) -> float:
    """F1 from (matched, proposed, true) counts."""
    return round(float(2 * counts[0] / max(counts[1] + counts[2], 1)), 3)


def main() -> None:
    """Print the report for the first and for the best of five completions."""
    data = Path(os.environ.get("STREETLOOM_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    path = data / "layouts" / "cmp.jsonl"
    print(json.dumps({"file": "layouts/cmp.jsonl", "first": run(path), "best of 5": run(path, n=5)}, indent=1))


if __name__ == "__main__":
    main()
