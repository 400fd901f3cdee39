"""Facade textures measured on ECP facades: synthesis, retargeting and inpainting; prints one JSON object.

Run as `python -m benchmarks.synthesis [DATA]`; DATA defaults to STREETLOOM_DATA or ../shared/data. Holes are ellipses
and boxes over 8-20 % of a facade; PSNR (dB) and SSIM are taken inside them, after the first call has compiled.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.labels import ROOF, WALL

FACADES = ("monge_10", "monge_26", "monge_55", "monge_74", "monge_107")
WALLS = (((12.0, 9.0), 3), ((19.0, 24.0), 6), ((16.0, 8.0), 4), ((25.0, 14.0), 8))
_CHIMNEY = 7


def load(folder: Path, name: str, *, side: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """One ECP facade: image (H, W, 3), labels (H, W) with chimneys as roof; resized to side x side px if given."""
    import cv2
    from PIL import Image

    image = np.array(Image.open(folder / "images" / f"{name}.jpg").convert("RGB"))
    labels = np.array(Image.open(folder / "labels" / f"{name}.png"))
    labels = np.where(labels == _CHIMNEY, ROOF, labels).astype(np.uint8)
    if side is not None:
        image = cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA)
        labels = cv2.resize(labels, (side, side), interpolation=cv2.INTER_NEAREST)
    return image, labels


def holes(shape: tuple[int, int]) -> dict[str, np.ndarray]:
    """A tree-like ellipse with a trunk, a box over the upper floors, and a car-like box on the street."""
    y, x = np.mgrid[: shape[0], : shape[1]] / np.array(shape)[:, None, None]
    tree = ((y - 0.62) / 0.22) ** 2 + ((x - 0.45) / 0.24) ** 2 < 1
    tree |= (y > 0.8) & (np.abs(x - 0.45) < 0.02)
    return {
        "tree": tree,
        "box": (np.abs(y - 0.48) < 0.16) & (np.abs(x - 0.55) < 0.15),
        "car": (np.abs(y - 0.88) < 0.1) & (np.abs(x - 0.5) < 0.25),
    }


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def quality(filled: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    from skimage.metrics import structural_similarity

    squared = (filled[mask].astype(float) - truth[mask]) ** 2
    _, similarity = structural_similarity(truth, filled, channel_axis=2, full=True)
    return float(10 * np.log10(255.0**2 / max(squared.mean(), 1e-9))), float(similarity[mask].mean())


def measure(folder: Path) -> dict[str, Any]:
    """Seconds and energies of synthesis, seconds of retargeting, and inpainting beside OpenCV's Telea."""
    import cv2

    from facade_core.texture import exemplar_scale, inpaint, retarget, synthesize

    image, labels = load(folder, FACADES[0], side=400)
    synthesize(image, labels, (200, 200))
    inpaint(image, holes(labels.shape)["box"], labels=labels)
    retarget(image, labels, (12.0, 9.0), floors=3, metres_per_pixel=0.045)
    synthesis, retargeting = [], []
    scores: dict[str, list[tuple[float, float, float]]] = {}
    for name in FACADES:
        square = load(folder, name, side=400)
        seconds, result = timed(partial(synthesize, *square, (400, 500), seed=1))
        synthesis.append({"facade": name, "seconds": round(seconds, 3), "energy": round(result.energy, 2)})
        image, labels = load(folder, name)
        scale = exemplar_scale(image, labels)
        for size, floors in WALLS:
            show = partial(retarget, image, labels, size, floors=floors, metres_per_pixel=scale)
            seconds, (wall,) = timed(show)
            pixels = f"{wall.image.shape[0]} x {wall.image.shape[1]}"
            retargeting.append({"facade": name, "pixels": pixels, "seconds": round(seconds, 3)})
        for mask in holes(labels.shape).values():
            hidden, seen = image.copy(), np.where(mask, WALL, labels).astype(np.uint8)
            hidden[mask] = 128
            calls: dict[str, Callable[[], Any]] = {
                "telea": partial(cv2.inpaint, hidden, mask.astype(np.uint8), 3, cv2.INPAINT_TELEA),
                "floors": partial(inpaint, hidden, mask, method="floors"),
                "floors with labels": partial(inpaint, hidden, mask, labels=seen, method="floors"),
                "tiles": partial(inpaint, hidden, mask, labels=seen, method="tiles"),
                "auto": partial(inpaint, hidden, mask, labels=seen),
            }
            for method, call in calls.items():
                seconds, filled = timed(call)
                scores.setdefault(method, []).append((seconds, *quality(filled, image, mask)))
    inpainting = {}
    for method, rows in scores.items():
        seconds, ratio, similarity = (round(float(v), 3) for v in np.mean(rows, axis=0))
        inpainting[method] = {"seconds": seconds, "psnr": ratio, "ssim": similarity}
    return {"synthesis": synthesis, "retargeting": retargeting, "inpainting": inpainting}


def main() -> None:
    """Print the measurements as JSON."""
    data = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("STREETLOOM_DATA", "../shared/data")
    print(json.dumps(measure(Path(data) / "facades" / "ecp"), indent=1))


if __name__ == "__main__":
    main()
