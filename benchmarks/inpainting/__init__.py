"""Inpainting of facades behind trees, cars and people: `python -m benchmarks.inpainting --data DIR` prints one JSON object.

40 facades of ecp and cmp without much else in view, held out of the training of the parser and of the layout model, each with
cut-outs of occluders/ put in front until 8 to 30 % are hidden. Inside the holes: PSNR (dB) and SSIM, means over facades;
perceptual, a distance of features of EfficientNet-Lite0; gradient_energy, that of the result over
the truth's (1 is as sharp), bands the same for details of about 1-2, 2-4 and 4-8 px; structure, mIoU of `parse` of the result
against the true labels over all holes together, beside that of the photo itself; hidden_rows, the share of the pixels that
`parse` gets right in holes where under a tenth of the row is visible; door_recall and door_precision, of the pixels of doors in
holes; seconds, the median. A method is sharp with gradient_energy 0.8 to 1.2.

Our methods get the parse of the visible part, and in "+ layout" the completed layout too. Peers are the
floors paper's own method (clone_and_split), OpenCV's Telea and Navier-Stokes, and scikit-image's biharmonic (at a quarter of
the size). --methods names those to measure.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.inpainting.cases import Case, cases
from benchmarks.inpainting.perceptual import perceptual_distance
from benchmarks.papers.clone_and_split import clone_and_split
from benchmarks.papers.tile_inpainting import inpaint_by_tiles
from benchmarks.parsing import confusion, scores
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.core.types import Element
from facade_core.facade.texture.inpainting import inpaint
from facade_core.parsing.elements import elements
from facade_core.parsing.segmenter import parse

OURS = tuple(f"{method}{given}" for method in ("floors", "tiles") for given in ("", " + layout"))
METHODS = ("clone_and_split", "telea", "navier_stokes", "biharmonic", *OURS)
SHARP = (0.8, 1.2)
_VISIBLE = 0.1  # share of a row below which it counts as hidden
_HIDDEN = 0.3  # an element hidden by more than this share was not observed


def observe(case: Case) -> tuple[np.ndarray, list[Element]]:
    """What the pipeline knows: labels parsed from the visible part, and the layout completed from its elements."""
    from facade_core.facade.layout.completion import complete
    from facade_core.facade.layout.visible_region import dilate_hidden_by_window, visible_region_boxes

    parsing = parse(np.dstack([case.image, np.where(case.mask, 0, 255).astype(np.uint8)]))
    seen = [e for e in elements(parsing) if _hidden_share(case.mask, e) <= _HIDDEN]
    if not seen:
        return parsing.labels, []
    height, width = case.mask.shape
    region = visible_region_boxes(dilate_hidden_by_window(case.mask, seen)) + [(e.x0, e.y0, e.x1, e.y1) for e in seen]
    shown = replace(parsing, occluded=case.mask | parsing.occluded)
    return parsing.labels, list(complete(seen, (0, 0, width, height), region, evidence=shown)[0].elements)


def _hidden_share(mask: np.ndarray, element: Element) -> float:
    part = mask[int(element.y0) : int(np.ceil(element.y1)), int(element.x0) : int(np.ceil(element.x1))]
    return float(part.mean()) if part.size else 0.0


def in_process(case: Case) -> dict[str, Callable[[], np.ndarray]]:
    """The methods that run here: those of OpenCV and scikit-image, and ours."""
    import cv2

    hidden, mask = case.image, case.mask.astype(np.uint8)
    calls: dict[str, Callable[[], np.ndarray]] = {
        "clone_and_split": lambda: clone_and_split(hidden, case.mask, np.random.default_rng(0)),
        "telea": lambda: cv2.inpaint(hidden, mask, 3, cv2.INPAINT_TELEA),
        "navier_stokes": lambda: cv2.inpaint(hidden, mask, 3, cv2.INPAINT_NS),
        "biharmonic": lambda: _biharmonic(hidden, case.mask),
    }
    labels, layout = observe(case)
    for name in OURS:
        method, _, given = name.partition(" + ")
        fill = inpaint if method == "floors" else inpaint_by_tiles
        calls[name] = partial(fill, hidden, case.mask, labels=labels, elements=layout if given else ())
    return calls


def _biharmonic(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """At a quarter of the size: its time grows with the cube of a hole's."""
    import cv2
    from skimage.restoration import inpaint_biharmonic

    size = tuple(max(16, side // 4) for side in mask.shape[::-1])
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    hole = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0
    filled = np.clip(inpaint_biharmonic(small, hole, channel_axis=2) * 255.0, 0, 255).astype(np.uint8)
    return np.where(mask[..., None], cv2.resize(filled, mask.shape[::-1], interpolation=cv2.INTER_CUBIC), image)


def similarity(result: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> dict[str, float]:
    """PSNR, SSIM and the energy of gradients and of three bands of detail in the hole."""
    from skimage.metrics import structural_similarity

    squared = (result[mask].astype(float) - truth[mask]) ** 2
    _, similar = structural_similarity(truth, result, channel_axis=2, full=True)
    found = {"psnr": 10 * np.log10(255.0**2 / max(squared.mean(), 1e-9)), "ssim": similar[mask].mean()}
    ours, true = (_energies(image, mask) for image in (result, truth))
    found |= dict(zip(("gradient_energy", *BANDS), ours / np.maximum(true, 1e-9), strict=True))
    return {name: float(value) for name, value in found.items()}


BANDS = ("band_1_2", "band_2_4", "band_4_8")


def _energies(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Mean squared gradient, and mean square of three differences of Gaussians, in the hole."""
    import cv2

    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)
    blurred = [grey, *(cv2.GaussianBlur(grey, (0, 0), sigma) for sigma in (1.0, 2.0, 4.0))]
    details = [(a - b) ** 2 for a, b in zip(blurred, blurred[1:], strict=False)]
    return np.array([band[mask].mean() for band in (across**2 + down**2, *details)])


def measure(chosen: Sequence[Case], work: Path, only: Sequence[str] = ()) -> dict[str, Any]:
    """Return all figures by method; pictures are left in `work` as CASE.METHOD.png. `only` names methods; all if empty."""
    from PIL import Image

    names = only or METHODS
    rows: dict[str, list[dict[str, float]]] = {name: [] for name in names}
    parsed: dict[str, list[np.ndarray]] = {name: [] for name in names}
    for number, case in enumerate(chosen):
        calls = in_process(case)
        for name in names:
            if not number:
                calls[name]()  # compiles
            start = time.perf_counter()
            filled = calls[name]()
            seconds = time.perf_counter() - start
            Image.fromarray(filled).save(work / f"{case.name}.{name}.png")
            perceptual = perceptual_distance(filled, case.truth, case.mask)
            rows[name].append(
                similarity(filled, case.truth, case.mask) | {"perceptual": perceptual, "seconds": seconds}
            )
            parsed[name].append(parse(filled).labels)
    figures: dict[str, Any] = {}
    for name, each in rows.items():
        means = {key: round(float(np.mean([row[key] for row in each])), 3) for key in each[0]}
        figures[name] = means | structure(chosen, parsed[name])
        figures[name]["seconds"] = round(statistics.median(row["seconds"] for row in each), 3)
    return figures


def structure(chosen: Sequence[Case], parsed: Sequence[np.ndarray]) -> dict[str, Any]:
    """What parsed labels (H, W) uint8 of the results tell of the true ones in all holes together; None where a hole has no
    hidden row, or no door."""
    every, hidden = (np.zeros((len(CLASSES), len(CLASSES)), np.int64) for _ in range(2))
    for case, labels in zip(chosen, parsed, strict=True):
        rows = (~case.mask).mean(1, keepdims=True) < _VISIBLE
        every += confusion(np.where(case.mask, case.labels, UNKNOWN), labels)
        hidden += confusion(np.where(case.mask & rows, case.labels, UNKNOWN), labels)
    found = scores(every)
    shares = {
        "hidden_rows": (hidden.trace(), hidden.sum()),
        "door_recall": (every[FacadeClass.DOOR, FacadeClass.DOOR], every[FacadeClass.DOOR].sum()),
        "door_precision": (every[FacadeClass.DOOR, FacadeClass.DOOR], every[:, FacadeClass.DOOR].sum()),
    }
    return {
        "structure_miou": found["mean_iou"],
        "structure_iou": found["iou"],
        **{name: round(float(part / whole), 3) if whole else None for name, (part, whole) in shares.items()},
    }


def goals(figures: dict[str, Any], ours: str = "floors + layout") -> dict[str, Any]:
    """Ours beside the best sharp peer, by what is to be reached; nothing where no peer is sharp."""
    sharp = {
        name: row
        for name, row in figures.items()
        if name not in (*OURS, "truth") and SHARP[0] <= row["gradient_energy"] <= SHARP[1]
    }
    if not sharp:
        return {}
    own = figures[ours]
    best = {key: max(row[key] for row in sharp.values()) for key in ("psnr", "ssim", "structure_miou")}
    nearest = min((row["perceptual"] for row in sharp.values() if "perceptual" in row), default=None)
    return {
        "sharp_peers": sorted(sharp),
        "psnr_gain": round(own["psnr"] - best["psnr"], 3),
        "ssim": own["ssim"],
        "best_ssim": best["ssim"],
        "perceptual_ratio": round(own["perceptual"] / nearest, 3) if nearest else None,
        "structure_gain": round(100 * (own["structure_miou"] - best["structure_miou"]), 1),
    }


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Inpainting of facades, ours and others', measured on the same holes.")
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--count", type=int, default=40, help="facades [40]")
    parser.add_argument("--out", type=Path, help="folder that keeps the pictures")
    parser.add_argument(
        "--methods", nargs="*", default=[], choices=METHODS, metavar="METHOD", help="which to measure [all]"
    )
    options = parser.parse_args(arguments)
    chosen = list(cases(options.data, options.count))
    with tempfile.TemporaryDirectory() as scratch:
        work = options.out or Path(scratch)
        work.mkdir(parents=True, exist_ok=True)
        figures = measure(chosen, work, options.methods)
    result = {
        "benchmark": "inpainting",
        "facades": len(chosen),
        "hidden": [round(float(f([c.mask.mean() for c in chosen])), 3) for f in (min, np.mean, max)],
        "photo": structure(chosen, [parse(case.truth).labels for case in chosen]),
        "methods": figures,
        "goals": {name: goals(figures, name) for name in OURS if name in figures},
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
