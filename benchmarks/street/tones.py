"""Contrast, colour and blacks of views of streets, of published runs and of photos, and what light costs.

python -m benchmarks.street.tones OUT... [--data DIR]

OUT: runs with the same streets, as one with and one without `texture.light`. DIR: streetphotos/swiss and /labelmefacade.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from benchmarks.look.outputs import read_output
from benchmarks.look.views import SIZE, render, street_cameras
from tasks.export.lighting import relighting_inputs
from tasks.publish.published_run import open_published_run

VIEWS, SEED = 24, 48
PHOTOS = {"swiss": "streetphotos/swiss/train/*.jpg", "labelmefacade": "streetphotos/labelmefacade/images/*.jpg"}
MAX_PHOTOS = 100
DARKEST, LIGHTEST = 5, 95


def measure_tones(pictures: Iterable[np.ndarray]) -> dict[str, float]:
    """Return the mean over pictures (..., 3) of their contrast, saturation, and dark and light ends, in steps of 255."""
    rows = []
    for rgb in pictures:
        grey, high = rgb @ np.array([0.299, 0.587, 0.114]), rgb.max(axis=-1).astype(float)
        saturation = ((high - rgb.min(axis=-1)) / np.maximum(high, 1)).mean()
        rows.append([grey.std(), saturation, *np.percentile(grey, [DARKEST, LIGHTEST])])
    names = ("standard_deviation", "saturation", "darkest", "lightest")
    return {name: round(float(value), 3) for name, value in zip(names, np.mean(rows, axis=0), strict=True)}


def measure_light_seconds(out: Path) -> float:
    """Return the processor seconds of the light of all charts of a run's own."""
    with open_published_run(out) as results:
        light = relighting_inputs(results).light
        charts = np.flatnonzero(results.plan.in_core).tolist()
        if light is None:
            return 0.0
        light.sunlight(charts[0])  # compiles
        start = time.process_time()
        for chart in charts[1:]:
            light.sunlight(chart)
        return round(time.process_time() - start, 1)


def main() -> None:
    """Print the figures of runs, and of photos, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("outs", nargs="+", type=Path, metavar="OUT")
    parser.add_argument("--data", type=Path, metavar="DIR")
    options = parser.parse_args()
    outputs, figures = [read_output(out) for out in options.outs], {}
    places = street_cameras(outputs, VIEWS, SEED)
    for number, (out, output) in enumerate(zip(options.outs, outputs, strict=True)):
        views = list(render(output, [place[number] for place in places]))
        figures[str(out)] = {
            "whole": measure_tones(view.rgb for view in views),
            "without_sky": measure_tones(view.rgb[np.isfinite(view.distance)] for view in views),
            "light_seconds": measure_light_seconds(out),
        }
    for name, pattern in PHOTOS.items() if options.data else ():
        paths = sorted(options.data.glob(pattern))[:MAX_PHOTOS]
        photos = (np.asarray(ImageOps.fit(Image.open(path).convert("RGB"), SIZE[::-1])) for path in paths)
        figures[name] = {"photos": len(paths), "whole": measure_tones(photos)}
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
