"""The street engine: `python -m benchmarks.street --data DIR [--only PART]` prints JSON.

truth: a synthetic street with real facade photos on its walls; panoramas rendered from known poses go back through
`propagate`, and each reading of Eq. 1 is scored by the PSNR (dB) of the facades it recovers, mean over facades with a 95 %
bootstrap interval, and by its difference from the pinned reading; with exact and with wrong poses. seams: a long wall cut into
charts, seen with changing exposure from behind a kiosk: how much more texels differ across chart borders than beside them,
and texels that took the kiosk's colour.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

PARTS = ("truth", "seams")


def main() -> None:
    """Measure and print."""
    import cv2

    from benchmarks.street import seams, truth

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder of real data")
    parser.add_argument("--only", choices=PARTS, action="append", help="parts to measure, all without")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    images = options.data / "facades" / "ecp" / "images"
    result: dict[str, object] = {"benchmark": "street", "load_before": round(os.getloadavg()[0], 1)}
    for part in options.only or PARTS:
        result[part] = {"truth": truth.measure, "seams": seams.measure}[part](images)
    result["load_after"] = round(os.getloadavg()[0], 1)
    print(json.dumps(result, indent=1))
