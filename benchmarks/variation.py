"""Variation hierarchies against what was promised of them, as JSON.

ECP and Art-Deco facades, with true labels and as parsed: levels, energies, bytes beside PNG, JPEG and WebP, seconds.
Painted facades: planted types. Samples: all different, and made of the elements of each type.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from facade_core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.types import Element
from facade_core.variation import Hierarchy, encode
from facade_core.variation.appearance import relabelling_cost
from facade_core.variation.sampling import exchange
from facade_core.variation.structure import relax

SAMPLES = 20
# Painted facades from this seed on were not looked at when weights and thresholds of the types were chosen.
_UNSEEN = 11


def elements_of(labels: np.ndarray, *, smallest: int = 40) -> list[Element]:
    """Boxes of the connected components of window, balcony, door and shop with at least `smallest` pixels."""
    from skimage.measure import label, regionprops

    found = []
    for name in ELEMENT_CLASSES:
        for region in regionprops(label(labels == CLASSES.index(name))):
            y0, x0, y1, x1 = region.bbox
            if region.area >= smallest and min(y1 - y0, x1 - x0) >= 4:
                found.append(Element(name, x0, y0, x1, y1))
    return found


def psnr(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB over the pixels of a mask."""
    error = ((a[mask].astype(float) - b[mask]) ** 2).mean()
    return float(10 * np.log10(255**2 / max(error, 1e-9)))


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


def facades(folder: Path, every: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Every n-th facade of a folder with images/ and labels/ (ids as in CLASSES): name, image, labels."""
    for path in sorted((folder / "images").iterdir())[::every]:
        labels = np.asarray(Image.open(folder / "labels" / f"{path.stem}.png"))
        yield path.stem, np.asarray(Image.open(path).convert("RGB")), labels


def energies(hierarchy: Hierarchy) -> tuple[bool, bool]:
    """Whether Eq. 1 fell with every accepted move, and whether ICM ended because no move was left, not for their number."""
    falls, settled = True, True
    for matrix in hierarchy.levels[0].grids:
        types, index = np.unique(matrix[matrix >= 0], return_inverse=True)
        structure = np.full(matrix.shape, -1, np.int32)
        structure[matrix >= 0] = index
        shown = hierarchy.representatives[types]
        first = 0
        for group in hierarchy.groups:
            if first <= shown[0] < first + len(group.boxes):
                cost = relabelling_cost(group.basis.patches(group.coordinates[shown - first]))
            first += len(group.boxes)
        for step in relax(structure, cost):
            if np.isfinite(step.alpha):
                falls &= bool((np.diff(step.energies) < 0).all())
                settled &= len(step.energies) <= 15 * structure.size
    return falls, settled


def measure(name: str, image: np.ndarray, elements: list[Element], *, others: bool) -> dict[str, object]:
    """One facade's figures; `others`: beside JPEG and WebP, too, which takes a second."""
    start = time.process_time()
    hierarchy = encode(image, elements)
    seconds = time.process_time() - start
    mask = np.zeros(image.shape[:2], bool)
    for e in elements:
        mask[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] = True
    first = hierarchy.reconstruct(0)
    parts = sum(len(coded(image[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)], "PNG")) for e in elements)
    falls, settled = energies(hierarchy)
    figures: dict[str, object] = {
        "facade": name,
        "elements": len(elements),
        "levels": len(hierarchy.levels),
        "types": len(hierarchy.representatives),
        "bytes": hierarchy.nbytes,
        "png elements and wall over bytes": (parts + len(coded(hierarchy.wall, "PNG"))) / hierarchy.nbytes,
        "psnr elements": psnr(image, first, mask) if mask.any() else None,
        "ssim": ssim(image, first),
        "energy falls": falls,
        "icm ended by itself": settled,
        "seconds": seconds,
    }
    if others and mask.any():
        decibel, likeness = psnr(image, first, mask), ssim(image, first)
        figures["jpeg at psnr of elements over bytes"] = (
            bytes_at(image, "JPEG", decibel, lambda shown: psnr(image, shown, mask)) / hierarchy.nbytes
        )
        for form in ("JPEG", "WEBP"):
            key = f"{form.lower()} at ssim over bytes"
            figures[key] = bytes_at(image, form, likeness, lambda shown: ssim(image, shown)) / hierarchy.nbytes
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
        "share with png elements and wall at least 10 times as large": round(
            float(np.mean([float(str(r["png elements and wall over bytes"])) >= 10 for r in rows])), 3
        ),
        "share in 0.15 s": round(float(np.mean([float(str(r["seconds"])) <= 0.15 for r in rows])), 3),
        "energy falls": all(r["energy falls"] for r in rows),
        "icm ended by itself": all(r["icm ended by itself"] for r in rows),
    }


def run(folder: Path, *, every: int = 4, parsed: bool = False, others: bool = True) -> dict[str, object]:
    """Figures over every n-th facade of a folder; parsed: elements from the parser instead of the true labels."""
    from facade_core.parse import elements as parsed_elements
    from facade_core.parse import parse

    rows: list[dict[str, object]] = []
    for name, image, labels in facades(folder, every):
        elements = parsed_elements(parse(image)) if parsed else elements_of(labels)
        if not rows:
            encode(image, elements)
        rows.append(measure(name, image, elements, others=others))
    return summary(rows)


def planted(seeds: int = 3) -> dict[str, object]:
    """Adjusted Rand index of the windows' types on painted facades with the states that were planted."""
    from sklearn.metrics import adjusted_rand_score

    from facade_core.synth import STYLES, facade

    found: dict[str, list[float]] = {}
    for seed in range(_UNSEEN, _UNSEEN + seeds):
        for style in STYLES:
            painted = facade((18.0, 16.0), floors=5, columns=6, style=style, metres_per_pixel=0.04, seed=seed)
            hierarchy = encode(painted.image, painted.elements)
            truth, types = [], []
            boxes = np.concatenate([g.boxes for g in hierarchy.groups])
            labels = np.repeat([g.label for g in hierarchy.groups], [len(g.boxes) for g in hierarchy.groups])
            photo = hierarchy.types_at(0)
            for e, state in zip(painted.elements, painted.element_states, strict=True):
                if e.label == "window":
                    apart = np.abs(boxes - (e.x0, e.y0, e.x1, e.y1)).sum(axis=1) + 1e6 * (labels != e.label)
                    truth.append(state)
                    types.append(photo[apart.argmin()])
            found.setdefault(style, []).append(float(adjusted_rand_score(truth, types)))
    scores = [score for of_style in found.values() for score in of_style]
    return {
        "adjusted rand, median": round(float(np.median(scores)), 3),
        "share at least 0.9": round(float(np.mean([s >= 0.9 for s in scores])), 3),
        "by style": {style: [round(s, 3) for s in of_style] for style, of_style in found.items()},
    }


def large() -> dict[str, object]:
    """Processor seconds of 15 floors of 30 windows: of relaxing matrices of so many types, and of encoding a painted facade."""
    from facade_core.synth import facade

    rng = np.random.default_rng(1)
    seconds: dict[str, object] = {}
    for types in (2, 10, 40, 100):  # the first is small: what is compiled, is then
        side = (3, 4) if types == 2 else (15, 30)
        structure = np.unique(rng.integers(types, size=side), return_inverse=True)[1].reshape(side).astype(np.int32)
        points = rng.random((types, 3))
        cost = ((points[:, None] - points) ** 2).sum(axis=2) ** 3
        start = time.process_time()
        relax(structure, cost / cost.max())
        seconds[f"relaxing 450 windows of {types} types, s"] = round(time.process_time() - start, 2)
    painted = facade((90.0, 50.0), floors=15, columns=30, style="brick", metres_per_pixel=0.06, seed=3)
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
        shown = [exchange(now, seed) for seed in range(SAMPLES)]
        kept.append(all((now[s] == now).all() and (np.sort(photo[s]) == np.sort(photo)).all() for s in shown))
    return {"facades": len(differ), "20 samples differ": float(np.mean(differ)), "counts kept": float(np.mean(kept))}


def main() -> None:
    """Print the report; --every N: every n-th facade only; --parsed: elements from the parser, too."""
    arguments = argparse.ArgumentParser(description=main.__doc__)
    arguments.add_argument("--every", type=int, default=1)
    arguments.add_argument("--parsed", action="store_true")
    arguments.add_argument("--json", action="store_true", help="the report is JSON in any case")
    given = arguments.parse_args()
    data = Path(os.environ.get("STREETLOOM_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "facades"
    report: dict[str, object] = {"load before": os.getloadavg()}
    for name in ("ecp", "artdeco"):
        report[f"{name}, true labels"] = run(data / name, every=given.every)
        if given.parsed:
            report[f"{name}, parsed"] = run(data / name, every=given.every, parsed=True, others=False)
    report["painted facades"] = planted()
    report["450 windows"] = large()
    report["samples, ecp"] = samples(data / "ecp", every=8 * given.every)
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
