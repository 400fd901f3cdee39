"""A learnt metric for types of windows, which is not shipped: trained on painted facades, against the present one.

Networks learn to tell planted states from small pictures of windows, the same features as the present descriptors and how each
differs from its group's median. `types`: all planted types, of windows as painted. `states`: what hangs at a window, whatever
its form, of windows also blurred, lit, mirrored in, moved, and behind railings. Then the windows of unseen painted facades and
of 20 ECP facades, told by eye, are of the type that the network says.
"""

from __future__ import annotations

import argparse
import json
import os
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from benchmarks.labelled_facades import elements_of, facades
from benchmarks.window_types import STATES, UNSEEN
from facade_core.core.types import Element
from facade_core.facade.layout.grids import box_array, group_by_size
from facade_core.facade.variation.element_types import cluster_types, compute_descriptors, fill_unknown_from_similar
from facade_core.facade.variation.patches import (
    align_boxes,
    box_mask,
    cut_patches,
    patch_size,
    relative_wall_brightness,
    wall_integral_images,
)
from facade_core.facade.variation.rendering import drawing_depth
from facade_core.synth.facade import paint_facade
from facade_core.synth.styles import STYLES

# Painted facades to learn from have seeds from here on; a window is told from so many pixels.
LEARNT, SIZE = 1000, (12, 20)
HANGING = ("curtains-open", "curtains-drawn", "blind-half", "blind-full", "clear")


class Windows(NamedTuple):
    """Of one size group: patches (N, h, w, 3), what of them is seen (N, h, w), and their states, "" where unknown."""

    patches: np.ndarray
    seen: np.ndarray
    states: list[str]


def windows_of(image: np.ndarray, elements: Sequence[Element], states: Sequence[str]) -> Iterator[Windows]:
    """As `facade_core.facade.variation.variations` cuts them."""
    box = box_array(elements).astype(np.int32)
    sums = wall_integral_images(image, box_mask(box, image.shape[:2]))
    front = box_mask(box[[drawing_depth(e.label) > drawing_depth("window") for e in elements]], image.shape[:2])
    for members in group_by_size(elements):
        if elements[members[0]].label == "window":
            size = patch_size(box[members])
            own = align_boxes(image, box[members], size)
            shade = relative_wall_brightness(sums, box[members])[:, None, None, None].astype(np.float32)
            seen = cut_patches(front.astype(np.float32), own, size) < 0.5
            yield Windows(cut_patches(image, own, size) / shade, seen, [states[i] for i in members])


def features(patches: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(N, 2400): colours and edges at a small size, and how they differ from the group's median."""
    around = max(3, patches.shape[2] // 2), max(3, patches.shape[1] // 2)
    values = np.empty((len(patches), *SIZE[::-1], 5), np.float32)
    known = np.empty((len(patches), *SIZE[::-1]), bool)
    for patch, visible, value, whole in zip(patches, seen, values, known, strict=True):
        grey = patch.mean(axis=2)
        across, down = cv2.Sobel(grey, -1, 1, 0, scale=1 / 8), cv2.Sobel(grey, -1, 0, 1, scale=1 / 8)
        usual = np.sqrt(np.maximum(cv2.blur(across * across + down * down, around), 0)) + 8
        value[..., :3] = cv2.resize(patch / 128 - 1, SIZE, interpolation=cv2.INTER_AREA)
        value[..., 3] = cv2.resize(np.abs(across) / usual, SIZE, interpolation=cv2.INTER_AREA)
        value[..., 4] = cv2.resize(np.abs(down) / usual, SIZE, interpolation=cv2.INTER_AREA)
        whole[:] = cv2.resize(visible.astype(np.float32), SIZE, interpolation=cv2.INTER_AREA) > 0.9
    flat = fill_unknown_from_similar(values, known).reshape(len(patches), -1)
    return np.concatenate([flat, flat - np.median(flat, axis=0)], axis=1)


def weathered(patches: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A group's windows under another light, blurred, mirroring, moved, with edges over their tops and railings before them."""
    number, height, width = patches.shape[:3]
    shown = (np.clip(patches / 255, 0, 1) ** rng.uniform(0.7, 1.4)) * 255 * rng.uniform(0.6, 1.4, 3)
    blur = rng.uniform(0, 1.2)
    for i in range(number):
        one = shown[i] * rng.uniform(0.85, 1.15) + rng.uniform(-12, 12)
        sky = cv2.resize(rng.uniform(0, 1, (3, 2)), (width, height), interpolation=cv2.INTER_CUBIC)[..., None]
        one += np.clip(1 - one.mean(axis=2, keepdims=True) / 110, 0, 1) * sky * rng.uniform(0, 110) * (0.7, 0.85, 1.15)
        if rng.random() < 0.5:
            one[: int(rng.uniform(0, 0.2) * height)] = rng.uniform(60, 230)
        if rng.random() < 0.5:
            top, dark = int(rng.uniform(0.65, 0.95) * height), rng.uniform(20, 60)
            one[top : top + max(1, height // 40)] = dark
            one[top:, :: max(3, width // int(rng.integers(6, 14)))] = dark
        moved = np.array([[1, 0, rng.uniform(-1, 1) * width / 14], [0, 1, rng.uniform(-1, 1) * height / 14]])
        one = cv2.warpAffine(one, moved, (width, height), borderMode=cv2.BORDER_REPLICATE)
        shown[i] = cv2.GaussianBlur(one, (0, 0), blur) if blur > 0.3 else one
    return np.clip(shown + rng.normal(0, 4, shown.shape), 0, 255).astype(np.float32)


def painted(number: int) -> Iterator[Windows]:
    """Windows of so many facades of all styles, sizes and densities, their boxes a pixel off."""
    for k in range(number):
        rng = np.random.default_rng(LEARNT + k)
        floors, columns = int(rng.integers(3, 7)), int(rng.integers(3, 9))
        size = 3.3 * floors + 3, float(rng.uniform(2.2, 3.6)) * columns + 1
        made = paint_facade(
            size,
            floors=floors,
            columns=columns,
            style=list(STYLES)[k % len(STYLES)],
            metres_per_pixel=float(rng.uniform(0.03, 0.07)),
            seed=LEARNT + k,
        )
        height, width = made.image.shape[:2]
        found, states = [], []
        for e, state in zip(made.elements, made.element_states, strict=True):
            box = np.clip(np.round([e.x0, e.y0, e.x1, e.y1]) + rng.integers(-1, 2, 4), 0, [width, height] * 2)
            if min(box[2] - box[0], box[3] - box[1]) >= 4:
                found.append(Element(e.label, *box.tolist()))
                states.append(state)
        yield from windows_of(made.image, found, states)


def learn(values: np.ndarray, truth: Sequence[str], epochs: int) -> Any:
    """A function from features to types."""
    from sklearn.neural_network import MLPClassifier

    mean, spread = values.mean(axis=0), values.std(axis=0) + 0.05
    network = MLPClassifier((64, 24), batch_size=256, alpha=1e-2, max_iter=epochs, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it stops before it has converged
        network.fit((values - mean) / spread, truth)
    return lambda patches, seen: network.predict((features(patches, seen) - mean) / spread)


def score(groups: Sequence[Windows], types: Any, *, apart: bool) -> float:
    """Adjusted Rand index over a facade; apart: windows of two size groups are two by truth."""
    from sklearn.metrics import adjusted_rand_score

    truth, found = [], []
    for k, group in enumerate(groups):
        for state, kind in zip(group.states, types(group.patches, group.seen), strict=True):
            if state:
                truth.append(f"{k} {state}" if apart else state)
                found.append(f"{k} {kind}")
    return float(adjusted_rand_score(truth, found))


def main() -> None:
    """Print figures of metrics on unseen painted facades and on ECP windows that were told by eye."""
    arguments = argparse.ArgumentParser(description=main.__doc__)
    arguments.add_argument(
        "--data", type=Path, help="folder that holds facades/; the environment's STREETLOOM_DATA without"
    )
    arguments.add_argument("--facades", type=int, default=720, help="painted ones to learn from")
    arguments.add_argument("--epochs", type=int, default=12)
    given = arguments.parse_args()
    shared = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = (given.data or Path(os.environ.get("STREETLOOM_DATA", shared))) / "facades" / "ecp"
    rng, plain, worn, truth = np.random.default_rng(0), [], [], []
    for group in painted(given.facades):
        plain.append(features(group.patches, group.seen))
        worn.append(features(weathered(group.patches, rng), group.seen))
        truth += group.states
    hanging = [next(name for name in HANGING if state.endswith(name)) for state in truth]
    metrics = {
        "one type a size group": lambda patches, seen: np.zeros(len(patches), int),
        "present": lambda patches, seen: cluster_types(
            compute_descriptors(fill_unknown_from_similar(patches, seen), seen)
        )[0],
        "types": learn(np.concatenate(plain), truth, given.epochs),
        "states": learn(np.concatenate(plain + worn), hanging * 2, given.epochs),
    }
    unseen = []
    for seed in range(UNSEEN, UNSEEN + 3):
        for style in STYLES:
            one = paint_facade((18.0, 16.0), floors=5, columns=6, style=style, metres_per_pixel=0.04, seed=seed)
            unseen.append(list(windows_of(one.image, one.elements, one.element_states)))
    known, real = json.loads(STATES.read_text())["windows"], []
    for name, image, labels in facades(folder, 1):
        if name in known:
            elements = elements_of(labels)
            told = {tuple(box): state for *box, state in known[name]}
            boxed = [told.get((int(e.x0), int(e.y0), int(e.x1), int(e.y1)), "") for e in elements]
            real.append(list(windows_of(image, elements, boxed)))
    report: dict[str, object] = {"windows learnt from": len(truth)}
    for name, types in metrics.items():
        report[name] = {
            where: {"median": round(float(np.median(scores)), 3), "mean": round(float(np.mean(scores)), 3)}
            for where, scores in (
                ("unseen painted facades", [score(one, types, apart=False) for one in unseen]),
                ("ECP windows told by eye", [score(one, types, apart=True) for one in real]),
            )
        }
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
