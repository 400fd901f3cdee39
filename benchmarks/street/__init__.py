"""The street engine: `python -m benchmarks.street --data DIR [--only PART]` prints JSON.

truth: a synthetic street with real facade photos on its walls; panoramas rendered from known poses go back through
`propagate`, and each reading of Eq. 1 is scored by the PSNR (dB) of the facades it recovers, mean over facades with a 95 %
bootstrap interval, and by its difference from the pinned reading; with exact and with wrong poses. seams: a long wall cut into
charts, seen with changing exposure from behind a kiosk: how much more texels differ across chart borders than beside them,
and texels that took the kiosk's colour. step: render and propagate on Ingolstadt's shells. store: what a viewpoint and a
street cost in the store, and its growth after expiry. scale: the same streets in a cut-out of Lyon and in the whole city.
workers: the street stage with two workers against one, on streets that share nothing.
incremental: units done again and seconds after each kind of change, against a fresh run.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

PARTS = ("truth", "seams", "step", "store", "scale", "workers", "incremental")
# Those that need no data.
ALONE = ("workers", "incremental")


def main() -> None:
    """Measure and print."""
    import cv2

    from benchmarks.street import incremental, scale, seams, step, store, truth, workers

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--data", type=Path, help="folder of real data; the part workers needs none")
    parser.add_argument("--only", choices=PARTS, action="append", help="parts to measure, all without")
    options = parser.parse_args()
    parts = options.only or PARTS
    if options.data is None and set(parts) - set(ALONE):
        parser.error(f"give --data; without it only {', '.join(ALONE)} can be measured")
    cv2.setNumThreads(1)
    measures = {
        "truth": lambda: truth.measure(options.data / "facades" / "ecp" / "images"),
        "seams": lambda: seams.measure(options.data / "facades" / "ecp" / "images"),
        "step": lambda: step.measure(options.data / "city" / "ingolstadt"),
        "store": lambda: store.measure(options.data / "city" / "ingolstadt"),
        "scale": lambda: scale.measure(options.data / "city" / "lyon" / "lod2.npz"),
        "incremental": incremental.measure,
        "workers": workers.measure,
    }
    result: dict[str, object] = {"benchmark": "street", "load_before": round(os.getloadavg()[0], 1)}
    for part in parts:
        result[part] = measures[part]()
    result["load_after"] = round(os.getloadavg()[0], 1)
    print(json.dumps(result, indent=1))
