"""The translation network: `python -m benchmarks.translator --data DIR [--models DIR] [--only PART]` prints one JSON object.

The test block is Ingolstadt with windows and doors as geometry, which no network is trained on; every wall is left to the
translator. inference: seconds for a panorama on two threads. windows: IoU of windows that the parser finds in facades of the
textured block with the model's own, against the same without texture and with swatches. shipped: what is
shipped beside swatches and no texture; tables: the paper's tables 1 and 2; composites: a network that learns from streets of
photos with and without texture, besides, beside one that does not and one of the paper's method alone;
--models holds the rows' networks, and those missing are trained with one budget each (extra: train). Distances are squared
kernel distances of EfficientNet-Lite0's features of crops of the finished streets to panoramas held out, with the kernel
(x . y + 1)^3, which is 125 for a picture and itself. pictures: one viewpoint by each translator, into --models.
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

PARTS = ("inference", "windows", "pictures", "shipped", "tables", "composites")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="benchmarks.translator", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder of real data")
    parser.add_argument("--models", type=Path, default=Path("out/translator"), help="networks of the tables' rows")
    parser.add_argument("--only", choices=PARTS, action="append", help="parts to measure, all without")
    options = parser.parse_args()
    result: dict[str, Any] = {"benchmark": "translator", "load_before": round(os.getloadavg()[0], 1)}
    measured = {
        "inference": inference,
        "windows": windows,
        "pictures": pictures,
        "shipped": shipped,
        "tables": tables,
        "composites": composites,
    }
    for part in options.only or PARTS:
        result[part] = measured[part](options)
    result["load_after"] = round(os.getloadavg()[0], 1)
    print(json.dumps(result, indent=1))


def inference(options: argparse.Namespace) -> dict[str, Any]:
    """Median seconds of the shipped network by panorama size."""
    from facade_core.street.translator import neural_translator

    network, found = neural_translator.load_translator(), {}
    for width in (512, 1024, 2048):
        image = np.random.default_rng(0).integers(0, 255, (width // 2, width, 3), dtype=np.uint8)
        network.translate_image(image)
        seconds = []
        for _ in range(5):
            begun = time.perf_counter()
            network.translate_image(image)
            seconds.append(time.perf_counter() - begun)
        found[f"{width} x {width // 2}"] = round(statistics.median(seconds), 3)
    return found


def windows(options: argparse.Namespace) -> dict[str, Any]:
    """Windows in the textured block by the shipped network, by swatches and without texture."""
    from benchmarks.translator import openings
    from benchmarks.translator.scenes import ingolstadt, walk
    from facade_core.street.propagation.render import render_panorama
    from facade_core.street.translator import neural_translator
    from facade_core.street.translator.translators import MaterialFieldTranslator

    scene, own, streets = ingolstadt(options.data)
    network, swatches = neural_translator.load_translator(), MaterialFieldTranslator(scene, streets, seed=7)
    translators = {
        "neural": lambda panorama, _: network.translate(panorama),
        "exemplar": lambda panorama, _: swatches.translate(panorama),
        "untextured": lambda _, bare: bare.rgb,
    }
    views = [viewpoint for street in own for viewpoint in street]
    panoramas: dict[str, list[Any]] = {}
    for name, translate in translators.items():
        panoramas[name] = []
        for street in own:
            walked = walk(scene, street, translate)
            rendered = (render_panorama(scene, walked.window, viewpoint, (1024, 2048)) for viewpoint in street)
            # without their points, which are two thirds of them: all are kept
            panoramas[name] += [replace(view, points=np.empty(0)) for view in rendered]
    return openings.measure(scene, views, panoramas)


def pictures(options: argparse.Namespace) -> dict[str, Any]:
    """One viewpoint of the test block without texture, by swatches and by the shipped network."""
    from PIL import Image

    from benchmarks.translator.scenes import between, ingolstadt, walk
    from facade_core.street.propagation.render import render_panorama
    from facade_core.street.translator import neural_translator
    from facade_core.street.translator.translators import MaterialFieldTranslator

    scene, own, streets = ingolstadt(options.data)
    network, swatches = neural_translator.load_translator(), MaterialFieldTranslator(scene, streets, seed=7)
    street = own[0]
    rows = []
    for translate in (
        lambda _, bare: bare.rgb,
        lambda panorama, _: swatches.translate(panorama),
        lambda panorama, _: network.translate(panorama),
    ):
        walked = walk(scene, street, translate)
        rows.append(render_panorama(scene, walked.window, between(street)[len(street) // 2], (512, 1024)).rgb[80:400])
    options.models.mkdir(parents=True, exist_ok=True)
    path = options.models / "translators.png"
    Image.fromarray(np.concatenate(rows)).save(path)
    return {"untextured, exemplar, neural from above": str(path)}


def shipped(options: argparse.Namespace) -> dict[str, Any]:
    """What is shipped, of the tables."""
    from benchmarks.translator import rows
    from facade_core.street.translator import neural_translator

    network = neural_translator.load_translator()
    return rows.shipped_alone(options.data, lambda panorama, _: network.translate(panorama))


def tables(options: argparse.Namespace) -> dict[str, Any]:
    """Tables 1 and 2."""
    from benchmarks.translator import rows
    from facade_core.street.translator import neural_translator

    seconds = rows.train_rows(options.data, options.models, rows.ROWS)
    network = neural_translator.load_translator()
    found = rows.measure(options.data, options.models, lambda panorama, _: network.translate(panorama))
    return found | {"training_seconds_a_step": seconds}


def composites(options: argparse.Namespace) -> dict[str, Any]:
    """What composite streets bring."""
    from benchmarks.translator import rows
    from facade_core.street.translator import neural_translator

    seconds = rows.train_rows(options.data, options.models, rows.COMPOSITES)
    network = neural_translator.load_translator()
    found = rows.composites(options.data, options.models, lambda panorama, _: network.translate(panorama))
    return found | {"training_seconds_a_step": seconds}
