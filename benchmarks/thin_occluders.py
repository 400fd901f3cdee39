"""Thin occluders on facades: `python -m benchmarks.thin_occluders --data DIR` prints one JSON object.

Posts, signals, signs, wires, bare trees, fences, scaffolds and parasols are drawn before facades that the parser was not
trained on: the held-out folds of ECP and CMP, and Art-Deco. recall: share of their pixels that is masked with its rim
(`clean_occluder_mask`), by kind; found: share of the occluders that are masked by half or more. cutouts: posts, signs and bare
trees of photos (occluders/) before the same facades. swiss: share of labelled fences, and of signs and signals, that is
masked in the Swiss test photos, in photos as taken. False masks on clean walls: `benchmarks.parsing --sets clean`. --sheet
writes a picture of one occluder of each kind with its mask.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from benchmarks.painter.thin_occluders import THIN_KINDS, paint_before_wall
from facade_core.parsing.occluders import clean_occluder_mask
from facade_core.parsing.segmenter import parse
from training.datasets.facades import (
    ARTDECO,
    CMP,
    ECP,
    LabelledFacade,
    read_dataset,
    split_facades_for_training,
)
from training.parser.views import estimate_metres_per_pixel

SEED = 40_000
# Smaller occluders, in pixels, are not measured.
MIN_PIXELS = 30
# Cut-outs of real occluders, and their heights in metres.
CUTOUTS = {
    "lamp_1": 4.0,
    "lamp_2": 4.0,
    "lamp_3": 4.0,
    "lamp_4": 4.0,
    "sign_2": 3.2,
    "sign_3": 3.5,
    "sign_4": 6.0,
    "sign_5": 3.0,
    "elec_2": 3.0,
    "elec_3": 5.0,
    "treet_11": 7.0,
    "treet_4": 7.0,
}

Mask = Callable[[np.ndarray], np.ndarray]
Hits = dict[str, list[tuple[int, int]]]


def held_out_facades(data: Path, each: int) -> list[LabelledFacade]:
    """So many facades of each set, spread over it."""
    sets = [
        split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))[1],
        split_facades_for_training(list(read_dataset(CMP, data / "facades" / "cmp")))[1],
        list(read_dataset(ARTDECO, data / "facades" / "artdeco")),
    ]
    return [facades[number * len(facades) // each] for facades in sets for number in range(each)]


def measure_drawn(facades: Sequence[LabelledFacade], mask: Mask, sheet: list[np.ndarray]) -> dict[str, Any]:
    """Recall by kind on drawn occluders."""
    hits: Hits = defaultdict(list)
    for kind_number, kind in enumerate(THIN_KINDS):
        for number, facade in enumerate(facades):
            rng = np.random.default_rng([SEED, kind_number, number])
            image, told = paint_before_wall(
                facade.image, kind, estimate_metres_per_pixel(facade.possible), len(facade.image), rng
            )
            truth = told == 1
            if truth.sum() < MIN_PIXELS:
                continue
            found = mask(image)
            hits[kind].append((int((found & truth).sum()), int(truth.sum())))
            if number == kind_number % len(facades):
                pictures = (image, tint(image, truth), tint(image, found))
                sheet.append(np.hstack([cv2.resize(one, (360, 360), interpolation=cv2.INTER_AREA) for one in pictures]))
    return {kind: recall(pairs) for kind, pairs in hits.items()}


def measure_cutouts(facades: Sequence[LabelledFacade], folder: Path, mask: Mask) -> dict[str, Any]:
    """Recall on cut-outs of photos, set on the ground before facades."""
    hits: Hits = defaultdict(list)
    for number, (name, metres) in enumerate(CUTOUTS.items()):
        piece = np.asarray(Image.open(folder / f"{name}.png").convert("RGBA"))
        facade = facades[number % len(facades)]
        rng = np.random.default_rng([SEED, number])
        high = max(1, round(metres / estimate_metres_per_pixel(facade.possible)))
        wide = max(1, round(piece.shape[1] * high / piece.shape[0]))
        small = cv2.resize(piece, (wide, high), interpolation=cv2.INTER_AREA)
        rows, columns = facade.labels.shape
        image, truth = facade.image.copy(), np.zeros((rows, columns), bool)
        left = int(rng.integers(0, max(1, columns - wide)))
        place = np.s_[max(0, rows - high) : rows, left : min(columns, left + wide)]
        part = small[max(0, high - rows) :, : columns - left]
        alpha = part[..., 3:].astype(np.float32) / 255
        image[place] = np.rint(image[place] * (1 - alpha) + part[..., :3] * alpha).astype(np.uint8)
        truth[place] = alpha[..., 0] >= 0.5
        hits[name.split("_")[0]].append((int((mask(image) & truth).sum()), int(truth.sum())))
    return {kind: recall(pairs) for kind, pairs in hits.items()}


def measure_swiss(folder: Path, mask: Mask) -> dict[str, Any]:
    """Share of the pixels of labelled fences, and of signs and signals, that is masked in photos as taken."""
    record = json.loads((folder / "annotations.coco.json").read_text(encoding="utf-8"))
    names = {category["id"]: category["name"] for category in record["categories"]}
    polygons: dict[int, list[tuple[str, Any]]] = defaultdict(list)
    for polygon in record["annotations"]:
        if (name := names[polygon["category_id"]]) in ("fence", "traffic-infrastructure"):
            polygons[polygon["image_id"]].append((name, polygon["segmentation"]))
    hits: Hits = defaultdict(list)
    for photo in (photo for photo in record["images"] if photo["id"] in polygons):
        found = mask(np.asarray(Image.open(folder / photo["file_name"]).convert("RGB")))
        for name, corners in polygons[photo["id"]]:
            points = np.rint(np.array(corners, np.float64).reshape(-1, 1, 2)).astype(np.int32)
            truth = cv2.fillPoly(np.zeros(found.shape, np.uint8), [points], 1) == 1
            hits[name].append((int((found & truth).sum()), int(truth.sum())))
    return {kind: recall(pairs) for kind, pairs in hits.items()}


def tint(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The image with a mask in magenta."""
    shown = image.copy()
    shown[mask] = (0.4 * image[mask] + 0.6 * np.array((255, 0, 255))).astype(np.uint8)
    return shown


def recall(hits: Sequence[tuple[int, int]]) -> dict[str, float]:
    """Recall of pixels, share of occluders found, and their number, from pixels masked and pixels in all."""
    masked, true = (sum(column) for column in zip(*hits, strict=True))
    return {
        "recall": round(masked / true, 4),
        "found": round(sum(2 * hit >= whole for hit, whole in hits) / len(hits), 4),
        "occluders": len(hits),
    }


def main(arguments: list[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--model", type=Path, help="another .onnx file, with its .json beside it")
    parser.add_argument("--each", type=int, default=8, help="facades of each set; default 8")
    parser.add_argument("--parts", nargs="*", choices=["drawn", "cutouts", "swiss"], help="all without it")
    parser.add_argument("--sheet", type=Path, help="picture of one occluder of each kind")
    options = parser.parse_args(arguments)

    def mask(image: np.ndarray) -> np.ndarray:
        return clean_occluder_mask(parse(image, model=options.model).occluded)[0]

    facades = held_out_facades(options.data, options.each)
    sheet: list[np.ndarray] = []
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "drawn": lambda: measure_drawn(facades, mask, sheet),
        "cutouts": lambda: measure_cutouts(facades, options.data / "occluders", mask),
        "swiss": lambda: measure_swiss(options.data / "streetphotos" / "swiss" / "test", mask),
    }
    result = {"benchmark": "thin_occluders"} | {name: parts[name]() for name in options.parts or parts}
    if options.sheet and sheet:
        Image.fromarray(np.vstack(sheet)).save(options.sheet, quality=85)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
