"""patchmatch-cython: `patchmatch-cython.py CASES OUT` fills CASES/*.image.png where CASES/*.mask.png is white.

Named with a hyphen: a script beside the package's own name would be imported in its place.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from patchmatch_cython import inpaint_pyramid
from PIL import Image

METHODS = {
    "patchmatch_cython": {},
    "patchmatch_cython_refined": {"em_loops": 2, "edge_weighted": True, "reverse_search": True, "hole_refine": 3},
}


def main(cases: Path, out: Path) -> dict[str, list[float]]:
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    for path in sorted(cases.glob("*.image.png")):
        case = path.name.removesuffix(".image.png")
        image = np.array(Image.open(path))
        mask = np.array(Image.open(cases / f"{case}.mask.png")) > 0
        for name, options in METHODS.items():
            start = time.perf_counter()
            filled = inpaint_pyramid(image, mask, seed=0, **options)
            seconds[name].append(time.perf_counter() - start)
            Image.fromarray(np.where(mask[..., None], filled, image)).save(out / f"{case}.{name}.png")
    return seconds


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]))))
