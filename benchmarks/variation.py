"""Variation hierarchies against what was promised of them, as JSON.

ECP and Art-Deco facades, with true labels and as parsed: levels, energies, bytes beside PNG, JPEG and WebP, seconds.
Painted facades: planted types; labelled windows: types told by eye. Samples: all different, and made of the elements of each
type. What was promised of all that is a table at the top.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.labelled_facades import elements_of, facades
from benchmarks.papers.variation_codec import papers_file
from benchmarks.window_types import labelled, planted
from facade_core.core.types import Element
from facade_core.facade.variation.codec import AVIF_OPTIONS
from facade_core.facade.variation.encoding import encode
from facade_core.facade.variation.sampling import permute_within_types
from facade_core.facade.variation.structure import regularise_structure_matrix
from facade_core.facade.variation.variations import Variations, find_variations

SAMPLES = 20


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Structural similarity of two images' brightness."""
    from skimage.metrics import structural_similarity

    grey = [np.asarray(Image.fromarray(i).convert("L")) for i in (a, b)]
    return float(structural_similarity(*grey))


def coded(image: np.ndarray, form: str, **options: int) -> bytes:
    """The image in another format."""
    out = io.BytesIO()
    Image.fromarray(image).save(out, form, **options)
    return out.getvalue()


def bytes_at(image: np.ndarray, form: str, wanted: float, quality_of: Callable[[np.ndarray], float]) -> int:
    """Bytes in the format at the lowest quality that reaches `wanted`, or at the highest one."""
    low, high = 1, 95
    while low < high:
        middle = (low + high) // 2
        shown = np.asarray(Image.open(io.BytesIO(coded(image, form, quality=middle))).convert("RGB"))
        low, high = (low, middle) if quality_of(shown) >= wanted else (middle + 1, high)
    return len(coded(image, form, quality=low))


def energies(of: Variations) -> tuple[bool, bool]:
    """Whether Eq. 1 fell with every accepted move, and whether ICM ended because no move was left, not for their number."""
    falls, settled = True, True
    for matrix in of.levels[0]:
        first, cost = next((f, c) for f, c in of.costs if f <= matrix.max() < f + len(c))
        for step in regularise_structure_matrix(np.where(matrix >= 0, matrix - first, -1), cost):
            if np.isfinite(step.alpha):
                falls &= bool((np.diff(step.energies) < 0).all())
                settled &= len(step.energies) <= 15 * matrix.size
    return falls, settled


def measure(name: str, image: np.ndarray, elements: list[Element], *, others: bool) -> dict[str, object]:
    """One facade's figures; `others`: beside the paper's codec, JPEG and WebP, too, which takes a second."""
    start = time.process_time()
    hierarchy = encode(image, elements)
    seconds = time.process_time() - start
    first, of = hierarchy.reconstruct(0), find_variations(image, elements)
    falls, settled = energies(of)
    figures: dict[str, object] = {
        "facade": name,
        "elements": len(elements),
        "levels": len(hierarchy.levels),
        "types": len(hierarchy.representatives),
        "bytes": hierarchy.nbytes,
        "bytes but the photo": hierarchy.nbytes - len(coded(image, "AVIF", **AVIF_OPTIONS)),
        "png of the photo over bytes": len(coded(image, "PNG")) / hierarchy.nbytes,
        "ssim": ssim(image, first),
        "energy falls": falls,
        "icm ended by itself": settled,
        "seconds": seconds,
    }
    if others:
        likeness = ssim(image, first)
        papers = papers_file(image, of)
        figures |= {
            f"bytes over {form.lower()} at ssim": hierarchy.nbytes
            / bytes_at(image, form, likeness, lambda shown: ssim(image, shown))
            for form in ("JPEG", "WEBP")
        }
        figures |= {
            "paper: bytes": len(papers.coded),
            "paper: ssim": ssim(image, papers.shown),
            "paper: png of the photo over bytes": len(coded(image, "PNG")) / len(papers.coded),
            "paper: bytes over jpeg at ssim": len(papers.coded)
            / bytes_at(image, "JPEG", ssim(image, papers.shown), lambda shown: ssim(image, shown)),
        }
    return figures


def summary(rows: list[dict[str, object]]) -> dict[str, object]:
    """Medians, the histogram of levels, and the shares of facades that keep what was promised."""
    numbers = {k for r in rows for k, v in r.items() if isinstance(v, (int, float)) and not isinstance(v, bool)}
    levels = [int(str(r["levels"])) for r in rows]
    return {
        "facades": len(rows),
        "median": {
            k: round(float(np.median([r[k] for r in rows if r.get(k) is not None])), 3) for k in sorted(numbers)
        },
        "facades by number of levels": {str(k): v for k, v in sorted(Counter(levels).items())},
        "share with 5 to 10 levels": round(float(np.mean([5 <= n <= 10 for n in levels])), 3),
        "share with at most .7 of a jpeg's bytes": round(
            float(np.mean([float(str(r.get("bytes over jpeg at ssim", np.nan))) <= 0.7 for r in rows])), 3
        ),
        "share with png at least 15 times as large": round(
            float(np.mean([float(str(r["png of the photo over bytes"])) >= 15 for r in rows])), 3
        ),
        "share in 0.15 s": round(float(np.mean([float(str(r["seconds"])) <= 0.15 for r in rows])), 3),
        "energy falls": all(r["energy falls"] for r in rows),
        "icm ended by itself": all(r["icm ended by itself"] for r in rows),
    }


def run(folder: Path, *, every: int = 4, parsed: bool = False, others: bool = True) -> dict[str, object]:
    """Figures over every n-th facade of a folder; parsed: elements from the parser instead of the true labels."""
    from facade_core.parsing.elements import elements as parsed_elements
    from facade_core.parsing.segmenter import parse

    rows: list[dict[str, object]] = []
    for name, image, labels in facades(folder, every):
        elements = parsed_elements(parse(image)) if parsed else elements_of(labels)
        if not rows:
            encode(image, elements)
        rows.append(measure(name, image, elements, others=others))
    return summary(rows)


def large() -> dict[str, object]:
    """Processor seconds of 15 floors of 30 windows: of relaxing matrices of so many types, and of encoding a painted facade."""
    from benchmarks.painter.facade import paint_facade

    rng = np.random.default_rng(1)
    seconds: dict[str, object] = {}
    for types in (2, 10, 40, 100):  # the first is small: what is compiled, is then
        side = (3, 4) if types == 2 else (15, 30)
        structure = np.unique(rng.integers(types, size=side), return_inverse=True)[1].reshape(side).astype(np.int32)
        points = rng.random((types, 3))
        cost = ((points[:, None] - points) ** 2).sum(axis=2) ** 3
        start = time.process_time()
        regularise_structure_matrix(structure, cost / cost.max())
        seconds[f"relaxing 450 windows of {types} types, s"] = round(time.process_time() - start, 2)
    painted = paint_facade((90.0, 50.0), floors=15, columns=30, style="brick", metres_per_pixel=0.06, seed=3)
    encode(painted.image, painted.elements[:2])
    start = time.process_time()
    encode(painted.image, painted.elements)
    del seconds["relaxing 450 windows of 2 types, s"]
    return seconds | {"encoding a painted facade, s": round(time.process_time() - start, 2)}


def samples(folder: Path, *, every: int) -> dict[str, object]:
    """Whether 20 samples of a middle level differ, and whether each keeps how often every element's type is shown."""
    differ, kept = [], []
    for _, image, labels in facades(folder, every):
        hierarchy = encode(image, elements_of(labels))
        level = len(hierarchy.levels) // 2
        now, photo = hierarchy.types_at(level), hierarchy.types_at(0)
        differ.append(len({hierarchy.sample(level, seed).tobytes() for seed in range(SAMPLES)}) == SAMPLES)
        shown = [permute_within_types(hierarchy.exchange_classes(level), seed) for seed in range(SAMPLES)]
        kept.append(all((now[s] == now).all() and (np.sort(photo[s]) == np.sort(photo)).all() for s in shown))
    return {"facades": len(differ), "20 samples differ": float(np.mean(differ)), "counts kept": float(np.mean(kept))}


def table(report: dict[str, Any]) -> list[dict[str, object]]:
    """What was promised of files, types and seconds, beside what is."""
    rows: list[tuple[str, float, str, bool]] = []

    def add(what: str, figure: float, sign: str, goal: float) -> None:
        rows.append((what, figure, f"{sign} {goal:g}", figure <= goal if sign == "<=" else figure >= goal))

    for name in ("ecp", "artdeco"):
        of = report[f"{name}, true labels"]
        add(f"{name}: bytes over those of a JPEG of the same SSIM", of["median"]["bytes over jpeg at ssim"], "<=", 0.7)
        add(f"{name}: PNG of the photo over bytes", of["median"]["png of the photo over bytes"], ">=", 15)
        add(f"{name}: facades with 5 to 10 levels", of["share with 5 to 10 levels"], ">=", 0.9)
    add("ARI of types, unseen painted facades", report["painted facades"]["adjusted rand, median"], ">=", 0.93)
    add("ARI of types, labelled ECP windows", report["labelled windows"]["adjusted rand, median"], ">=", 0.93)
    for what, figure in report["450 windows"].items():
        if what.startswith("relaxing"):
            add(what, figure, "<=", 1)
    return [dict(zip(("what", "figure", "goal", "reached"), row, strict=True)) for row in rows]


def main() -> None:
    """Print the report; --every N: every n-th facade only; --parsed: elements from the parser, too."""
    arguments = argparse.ArgumentParser(description=main.__doc__)
    arguments.add_argument("--every", type=int, default=1)
    arguments.add_argument("--parsed", action="store_true")
    arguments.add_argument(
        "--data", type=Path, help="folder that holds facades/; the environment's STREETLOOM_DATA without"
    )
    arguments.add_argument("--json", action="store_true", help="the report is JSON in any case")
    given = arguments.parse_args()
    shared = Path(__file__).resolve().parents[2] / "shared" / "data"
    data = (given.data or Path(os.environ.get("STREETLOOM_DATA", shared))) / "facades"
    report: dict[str, object] = {"load before": os.getloadavg()}
    for name in ("ecp", "artdeco"):
        report[f"{name}, true labels"] = run(data / name, every=given.every)
        if given.parsed:
            report[f"{name}, parsed"] = run(data / name, every=given.every, parsed=True, others=False)
    report["painted facades"] = planted()
    report["labelled windows"] = labelled(data / "ecp")
    report["450 windows"] = large()
    report["samples, ecp"] = samples(data / "ecp", every=8 * given.every)
    print(json.dumps({"table": table(report)} | report, indent=1))


if __name__ == "__main__":
    main()
