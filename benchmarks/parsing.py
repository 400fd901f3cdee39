"""Scores of a parser: `python -m benchmarks.parsing --data DIR` prints one JSON object.

Each set is measured on the facades that the model's .json does not name as trained on: the shipped model's ecp figures
are those of the held-out fold of `training.datasets.facades.split_facades_for_training`, artdeco and ruemonge2014 (the
authors' validation part)
measure transfer. Void is left out, chimneys are roof. seconds_per_image is the median wall time of `parse`.
elements compares the boxes of `elements` in the parse and in the true labels, one to one at IoU 0.5 or more.
occluders is measured on street photos of labelmefacade: vegetation and vehicles against all else that is labelled.
behind is what is guessed behind trees, cars and people: cut-outs of occluders/ put in front of artdeco's facades,
whose labels run on behind what their photos show (`--model` with the fold's network is the amodal model).
in_front is how many of the vehicles and people marked before the held-out facades of ecp are found, and clean how much is
taken for something in front where nothing is: above the ground floor of these facades and of cmp's held-out ones, and on
painted facades (`benchmarks.in_front`). outline is where facades end: cmp's held-out pictures cut to them, and sky, street and
neighbours of street photos (`benchmarks.outline`).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import statistics
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import in_front, outline
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN
from facade_core.core.model_file import read_model_record
from facade_core.core.types import Element
from facade_core.parsing.elements import elements
from facade_core.parsing.network import Network
from facade_core.parsing.segmenter import (
    DEFAULT_MODEL,
    facade_surroundings_mask,
    load_segmenter,
    parse,
    parse_with_segmenter,
)
from training.datasets.facades import (
    ARTDECO,
    CMP,
    ECP,
    LABELMEFACADE,
    RUEMONGE,
    LabelledFacade,
    read_dataset,
    read_swiss_street_photos,
    split_facades_for_training,
)
from training.parser.calibration import mark_matched_elements

SETS = {
    "ecp": (ECP, "facades/ecp"),
    "artdeco": (ARTDECO, "facades/artdeco"),
    "ruemonge2014": (RUEMONGE, "facades/ruemonge2014/val"),
}
OTHERS = ("labelmefacade", "behind", "in_front", "clean", "outline")


def measure(
    facades: Iterable[LabelledFacade],
    *,
    model: Path | None = None,
    regular: bool = True,
    one_view: bool = False,
) -> dict[str, Any]:
    """Parse each facade, score the pixels whose true class is known, and the elements.

    regular: with the last step, which makes windows regular; one_view: without mirrored and scaled views.
    """
    segmenter = load_segmenter(model)
    if one_view and isinstance(segmenter, Network):
        segmenter = dataclasses.replace(segmenter, views=((1.0, False),))
    counts = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    boxes: Counter[tuple[str, str]] = Counter()
    seconds = []
    for facade in facades:
        start = time.perf_counter()
        labels = parse_with_segmenter(facade.image, segmenter, regularise=regular).labels
        seconds.append(time.perf_counter() - start)
        counts += confusion(facade.labels, labels)
        boxes += matches(elements(facade.labels), elements(np.where(facade.labels == UNKNOWN, UNKNOWN, labels)))
    return {
        **scores(counts),
        "elements": {name: f1(boxes, name) for name in ELEMENT_CLASSES},
        "images": len(seconds),
        "seconds_per_image": round(statistics.median(seconds), 3),
    }


def confusion(truth: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Pixels by true class (row) and parsed class (column); pixels without a true class are left out."""
    known = truth < len(CLASSES)
    pairs = truth[known].astype(np.intp) * len(CLASSES) + labels[known]
    return np.bincount(pairs, minlength=len(CLASSES) ** 2).reshape(len(CLASSES), len(CLASSES))


def scores(counts: np.ndarray) -> dict[str, Any]:
    """Pixel accuracy, mean class accuracy, mIoU and IoU per class; classes neither true nor parsed are left out."""
    hits, true, parsed = np.diag(counts), counts.sum(1), counts.sum(0)
    accuracy = hits[true > 0] / true[true > 0]
    shown = true + parsed > 0
    iou = hits[shown] / (true + parsed - hits)[shown]
    names = np.array(CLASSES)[shown]
    return {
        "pixel_accuracy": round(float(hits.sum() / counts.sum()), 4),
        "mean_class_accuracy": round(float(accuracy.mean()), 4),
        "mean_iou": round(float(iou.mean()), 4),
        "iou": {str(name): round(float(value), 4) for name, value in zip(names, iou, strict=True)},
    }


def matches(true: Sequence[Element], elements: Sequence[Element]) -> Counter[tuple[str, str]]:
    """How many elements of a class are (class, "true"), (class, "found") and (class, "both"): paired one to one for
    the greatest sum of IoU, where it is at least 0.5."""
    counts: Counter[tuple[str, str]] = Counter()
    good = mark_matched_elements(elements, true)
    for name in ELEMENT_CLASSES:
        counts[name, "true"] = sum(element.label == name for element in true)
        counts[name, "found"] = sum(element.label == name for element in elements)
        counts[name, "both"] = sum(
            bool(is_right) and one.label == name for one, is_right in zip(elements, good, strict=True)
        )
    return counts


def f1(counts: Counter[tuple[str, str]], name: str) -> float | None:
    """F1 of a class; None where there is none, true or found."""
    both = counts[name, "true"] + counts[name, "found"]
    return round(2 * counts[name, "both"] / both, 4) if both else None


def measure_occluders(photos: Iterable[LabelledFacade], *, model: Path | None = None) -> dict[str, Any]:
    """IoU, precision and recall of the occluded pixels, over all photos together."""
    both = found = true = images = 0
    for photo in photos:
        known = photo.occluder != UNKNOWN
        truth, seen = photo.occluder[known] == 1, parse(photo.image, model=model).occluded[known]
        both += int((truth & seen).sum())
        found, true, images = found + int(seen.sum()), true + int(truth.sum()), images + 1
    return {
        "iou": round(both / max(1, true + found - both), 4),
        "precision": round(both / max(1, found), 4),
        "recall": round(both / max(1, true), 4),
        "images": images,
    }


def measure_behind(
    facades: Iterable[LabelledFacade], pieces: Sequence[np.ndarray], *, model: Path | None = None
) -> dict[str, Any]:
    """Each facade with cut-outs (h, w, 4) RGBA put in front of its foot: the pixel accuracy of what is behind them and
    of the rest, and how well the pieces themselves are found. Truth must run behind what the photos show already."""
    counts = np.zeros((2, len(CLASSES), len(CLASSES)), np.int64)
    both = found = true = images = 0
    for number, facade in enumerate(facades):
        image, hidden = put_in_front(facade.image, pieces, np.random.default_rng(number))
        parsing = parse(image, model=model)
        for part, where in enumerate((hidden, ~hidden)):
            counts[part] += confusion(facade.labels[where], parsing.labels[where])
        both += int((hidden & parsing.occluded).sum())
        found, true, images = found + int(parsing.occluded.sum()), true + int(hidden.sum()), images + 1
    return {
        "pixel_accuracy_behind": scores(counts[0])["pixel_accuracy"],
        "pixel_accuracy_beside": scores(counts[1])["pixel_accuracy"],
        "recall": round(both / true, 4),
        "found_share": round(found / true, 4),
        "images": images,
    }


def measure_in_front(data: Path, name: str, model: Path | None) -> dict[str, Any]:
    """The figures of in_front or of clean."""

    def hidden(image: np.ndarray) -> np.ndarray:
        return parse(image, model=model).occluded

    _, held_out = split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))
    if name == "in_front":
        return in_front.measure_things(held_out, in_front.marked(), hidden)
    return {
        "ecp": in_front.false_masks(held_out, hidden),
        "cmp": in_front.false_masks(
            split_facades_for_training(list(read_dataset(CMP, data / "facades" / "cmp")))[1], hidden
        ),
        "painted": in_front.false_masks_painted(hidden),
    }


def measure_outline(data: Path, model: Path | None) -> dict[str, Any]:
    """The figures of outline."""

    def outside(image: np.ndarray) -> np.ndarray:
        return facade_surroundings_mask(image, np.zeros(image.shape[:2], bool), model=model)

    _, held_out = split_facades_for_training(list(read_dataset(CMP, data / "facades" / "cmp")))
    photos = data / "streetphotos"
    return {
        "cmp": outline.measure_outside(held_out, outside) | outline.measure_boxes(held_out, outside),
        "swiss": outline.measure_outside(read_swiss_street_photos(photos / "swiss" / "test"), outside),
        "labelmefacade": outline.measure_outside(read_dataset(LABELMEFACADE, photos / "labelmefacade"), outside),
    }


def put_in_front(
    image: np.ndarray, pieces: Sequence[np.ndarray], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The image with three pieces that stand on its bottom, a fifth to a half as high as it, and where they are."""
    import cv2

    image, hidden = image.copy(), np.zeros(image.shape[:2], bool)
    height, width = image.shape[:2]
    for number in rng.choice(len(pieces), 3, replace=False):
        piece = pieces[number]
        high = max(1, round(height * rng.uniform(0.2, 0.5)))
        wide = min(width, max(1, round(piece.shape[1] * high / piece.shape[0])))
        piece = cv2.resize(piece, (wide, high), interpolation=cv2.INTER_AREA)
        left = int(rng.integers(width - wide + 1))
        place, solid = (slice(height - high, height), slice(left, left + wide)), piece[..., 3] >= 128
        image[place][solid], hidden[place][solid] = piece[..., :3][solid], True
    return image, hidden


def unseen(facades: Iterable[LabelledFacade], name: str, model: Path | None) -> Iterator[LabelledFacade]:
    """The facades of a set that the model was not trained on."""
    trained_on = set(read_model_record(model or DEFAULT_MODEL).get("training_set", []))
    return (facade for facade in facades if f"{name}/{facade.name}" not in trained_on)


def seconds_of_a_large_facade(model: Path | None) -> float:
    """Wall time of `parse` for 1000 x 700 pixels, the model loaded."""
    image = np.random.default_rng(0).integers(0, 256, (700, 1000, 3), dtype=np.uint8)
    times = []
    for _ in range(4):
        start = time.perf_counter()
        parse(image, model=model)
        times.append(time.perf_counter() - start)
    return round(statistics.median(times[1:]), 3)


def _pieces(folder: Path) -> list[np.ndarray]:
    from PIL import Image

    return [np.asarray(Image.open(path).convert("RGBA")) for path in sorted(folder.glob("*.png"))]


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Score a parser on facades that it was not trained on.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/ and streetphotos/",
    )
    parser.add_argument("--model", type=Path, help="another .onnx file, with its .json beside it")
    parser.add_argument("--sets", nargs="*", choices=[*SETS, *OTHERS], help="all without it")
    parser.add_argument(
        "--ablation",
        action="store_true",
        help="measure too without the step that makes parses regular, and in one view",
    )
    options = parser.parse_args(arguments)
    chosen = options.sets or [*SETS, *OTHERS]
    result: dict[str, Any] = {"benchmark": "parsing", "model": (options.model or DEFAULT_MODEL).name}
    for name in chosen:
        if name in SETS:
            recipe, folder = SETS[name]
            facades = list(unseen(read_dataset(recipe, options.data / folder), name, options.model))
            result[name] = measure(facades, model=options.model)
            if options.ablation:
                result[f"{name} as parsed"] = measure(facades, model=options.model, regular=False)
                result[f"{name} in one view"] = measure(facades, model=options.model, one_view=True)
        elif name == "behind":
            facades = list(
                unseen(read_dataset(ARTDECO, options.data / "facades" / "artdeco"), "artdeco", options.model)
            )
            result["behind"] = measure_behind(facades, _pieces(options.data / "occluders"), model=options.model)
        elif name in ("in_front", "clean"):
            result[name] = measure_in_front(options.data, name, options.model)
        elif name == "outline":
            result[name] = measure_outline(options.data, options.model)
        else:
            photos = read_dataset(LABELMEFACADE, options.data / "streetphotos" / "labelmefacade")
            result["occluders"] = measure_occluders(photos, model=options.model)
    result["seconds_1000x700"] = seconds_of_a_large_facade(options.model)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
