"""pypatchmatch: `pypatchmatch.py CASES OUT` fills CASES/*.image.png where CASES/*.mask.png is white.

Its regularity map holds each pixel's place within a period, of CASES/*.pitch.json: [floor height, bay width] in px.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import patchmatch
from PIL import Image

METHODS = {
    "patchmatch_3": lambda image, mask, _: patchmatch.inpaint(image, mask, patch_size=3),
    "patchmatch_7": lambda image, mask, _: patchmatch.inpaint(image, mask, patch_size=7),
    "patchmatch_regularity": lambda image, mask, place: patchmatch.inpaint_regularity(image, mask, place, patch_size=7),
}


def places(shape: tuple[int, int], pitch: list[int]) -> np.ndarray:
    """Where pixels lie within their period, 0 to 1, down and across: (h, w, 3) float32."""
    down, across = ((np.arange(side) % step) / step for side, step in zip(shape, pitch, strict=True))
    grid = np.meshgrid(down, across, indexing="ij")
    return np.stack([*grid, np.zeros(shape)], 2).astype(np.float32)


def main(cases: Path, out: Path) -> dict[str, list[float]]:
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    for path in sorted(cases.glob("*.image.png")):
        case = path.name.removesuffix(".image.png")
        image = np.array(Image.open(path))
        mask = np.array(Image.open(cases / f"{case}.mask.png"))
        place = places(mask.shape, json.loads((cases / f"{case}.pitch.json").read_text()))
        for name, fill in METHODS.items():
            patchmatch.set_random_seed(0)
            start = time.perf_counter()
            filled = fill(image, mask, place)
            seconds[name].append(time.perf_counter() - start)
            filled = np.where(mask[..., None] > 0, filled, image)
            Image.fromarray(filled).save(out / f"{case}.{name}.png")
    return seconds


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]))))
