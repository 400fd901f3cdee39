"""object-remove: `object-remove.py CASES OUT` fills CASES/*.image.png where CASES/*.mask.png is white; it chooses its engine.

Named with a hyphen, as the package is.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from object_remove import RemoveObjectJob
from PIL import Image

NAME = "object_remove"


def main(cases: Path, out: Path) -> dict[str, list[float]]:
    seconds = []
    for path in sorted(cases.glob("*.image.png")):
        case = path.name.removesuffix(".image.png")
        image = np.array(Image.open(path))
        mask = np.array(Image.open(cases / f"{case}.mask.png")) > 0
        start = time.perf_counter()
        filled = RemoveObjectJob(image, device=None).run(mask, refine_mask=False).image
        seconds.append(time.perf_counter() - start)
        filled = np.rint(np.clip(filled, 0, 1) * 255).astype(np.uint8)
        Image.fromarray(np.where(mask[..., None], filled, image)).save(out / f"{case}.{NAME}.png")
    return {NAME: seconds}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]))))
