"""The translation network of the street paper: `python -m benchmarks.papers.translator --data DIR [--only PART]`.

No run uses the network: it darkens the ground and blurs, and the material field is preferred by eye (docs/decisions/0166).
`neural_translator` applies the network in models/ to a panorama; `train` trains one (extra: train).

The benchmark prints one JSON object. The test block is Ingolstadt with windows and doors as geometry, which no network is
trained on; every wall is left untextured. inference: seconds for a panorama on two threads. windows: IoU of windows that the
parser finds in facades of the textured block with the model's own, against the same without texture and with the material
field. sharpness: gradient energy of translated panoramas, divided by that of the painted ones. pretrained: kernel distances
of the network in models/, the material field and no texture. tables: the paper's tables 1 and 2; --models holds the rows'
networks, and those missing are trained with one budget each, on procedural streets and those of --from (extra: train).
Distances are squared kernel distances of EfficientNet-Lite0's features of crops of the finished streets to panoramas held
out, with the kernel (x . y + 1)^3, which is 125 for a picture and itself. pictures: one viewpoint by each translator, into
--models.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

PARTS = ("inference", "windows", "sharpness", "pictures", "pretrained", "tables")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="benchmarks.papers.translator", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder of real data")
    parser.add_argument("--models", type=Path, default=Path("out/translator"), help="networks of the tables' rows")
    parser.add_argument("--from", type=Path, action="append", default=[], dest="runs", help="runs that rows learn from")
    parser.add_argument("--only", choices=PARTS, action="append", help="parts to measure, all without")
    options = parser.parse_args()
    result: dict[str, Any] = {"benchmark": "translator", "load_before": round(os.getloadavg()[0], 1)}
    measured = {
        "inference": inference,
        "windows": windows,
        "sharpness": measure_sharpness,
        "pictures": pictures,
        "pretrained": measure_pretrained,
        "tables": tables,
    }
    for part in options.only or PARTS:
        result[part] = measured[part](options)
    result["load_after"] = round(os.getloadavg()[0], 1)
    print(json.dumps(result, indent=1))


def inference(options: argparse.Namespace) -> dict[str, Any]:
    """Median seconds of the pretrained network by panorama size."""
    from benchmarks.papers.translator import neural_translator

    network, found = neural_translator.load_colour_network(), {}
    for width in (512, 1024, 2048):
        image = np.random.default_rng(0).integers(0, 255, (width // 2, width, 3), dtype=np.uint8)
        known = np.zeros(image.shape[:2], bool)
        network.translate_image(image, known)
        seconds = []
        for _ in range(5):
            begun = time.perf_counter()
            network.translate_image(image, known)
            seconds.append(time.perf_counter() - begun)
        found[f"{width} x {width // 2}"] = round(statistics.median(seconds), 3)
    return found


def windows(options: argparse.Namespace) -> dict[str, Any]:
    """Windows in the textured block by the pretrained network, by the material field and without texture."""
    from benchmarks.papers.translator import openings
    from benchmarks.papers.translator.scenes import ingolstadt, walk
    from facade_core.street.propagation.render import render_panorama

    scene, own, streets = ingolstadt(options.data)
    views = [viewpoint for street in own for viewpoint in street]
    panoramas: dict[str, list[Any]] = {}
    for name, translate in _translators(scene, streets).items():
        panoramas[name] = []
        for street in own:
            walked = walk(scene, street, translate)
            rendered = (render_panorama(scene, walked.window, viewpoint, (1024, 2048)) for viewpoint in street)
            # without their points, which are two thirds of them: all are kept
            panoramas[name] += [replace(view, points=np.empty(0)) for view in rendered]
    return openings.measure(scene, views, panoramas)


def measure_sharpness(options: argparse.Namespace) -> dict[str, Any]:
    """Gradient energy of translated panoramas over that of the painted ones, by viewpoint."""
    from benchmarks.papers.translator import neural_translator
    from benchmarks.papers.translator.scenes import WIDTH, ingolstadt, walk
    from benchmarks.street.truth import interval
    from facade_core.street.materials.field import MaterialField
    from benchmarks.papers.translator.translators import MaterialFieldTranslator

    scene, own, streets = ingolstadt(options.data)
    painter = MaterialFieldTranslator(scene, MaterialField(scene, streets, seed=7))
    network = neural_translator.NeuralTranslator(neural_translator.load_colour_network(), painter)
    shares: list[float] = []

    def translate(panorama: Any, _: Any) -> np.ndarray:
        painted, translated = painter.translate(panorama), network.translate(panorama)
        shown = (panorama.chart >= 0) & ~panorama.textured
        if shown.any():
            shares.append(_energy(translated, shown) / _energy(painted, shown))
        return translated

    for street in own:
        walk(scene, street, translate)
    return {"width": WIDTH, "viewpoints": len(shares), "share": interval(shares)}


def _energy(rgb: np.ndarray, shown: np.ndarray) -> float:
    """Mean squared gradient of brightness, of pixels whose neighbours are shown too."""
    grey = rgb.astype(np.float64) @ np.array([0.299, 0.587, 0.114])
    inside = shown[:-1, :-1] & shown[1:, :-1] & shown[:-1, 1:]
    down, right = np.diff(grey, axis=0)[:, :-1], np.diff(grey, axis=1)[:-1]
    return float((down**2 + right**2)[inside].mean())


def pictures(options: argparse.Namespace) -> dict[str, Any]:
    """One viewpoint of the test block without texture, by the material field and by the pretrained network."""
    from PIL import Image

    from benchmarks.papers.translator.scenes import between, ingolstadt, walk
    from facade_core.street.propagation.render import render_panorama

    scene, own, streets = ingolstadt(options.data)
    street, rows = own[0], []
    for translate in _translators(scene, streets).values():
        walked = walk(scene, street, translate)
        rows.append(render_panorama(scene, walked.window, between(street)[len(street) // 2], (512, 1024)).rgb[80:400])
    options.models.mkdir(parents=True, exist_ok=True)
    path = options.models / "translators.png"
    Image.fromarray(np.concatenate(rows)).save(path)
    return {"untextured, material field, network from above": str(path)}


def _translators(scene: Any, streets: Any) -> dict[str, Any]:
    """No texture, the material field and the pretrained network."""
    from benchmarks.papers.translator import neural_translator
    from facade_core.street.materials.field import MaterialField
    from benchmarks.papers.translator.translators import MaterialFieldTranslator

    painter = MaterialFieldTranslator(scene, MaterialField(scene, streets, seed=7))
    network = neural_translator.NeuralTranslator(neural_translator.load_colour_network(), painter)
    return {
        "untextured": lambda _, bare: bare.rgb,
        "material field": lambda panorama, _: painter.translate(panorama),
        "network": lambda panorama, _: network.translate(panorama),
    }


def measure_pretrained(options: argparse.Namespace) -> dict[str, Any]:
    """Kernel distances of the pretrained network, of the material field and without texture."""
    from benchmarks.papers.translator import neural_translator, rows

    return rows.pretrained_alone(options.data, neural_translator.load_colour_network())


def tables(options: argparse.Namespace) -> dict[str, Any]:
    """Tables 1 and 2."""
    from benchmarks.papers.translator import neural_translator, rows

    seconds = rows.train_rows(options.data, options.models, rows.ROWS, runs=options.runs)
    found = rows.measure(options.data, options.models, neural_translator.load_colour_network())
    return found | {"training_seconds_a_step": seconds}
