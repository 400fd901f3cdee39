"""opencv-contrib's shift map: `shiftmap.py CASES OUT` fills CASES/*.image.png where CASES/*.mask.png is white."""

import json
import sys
import time
from pathlib import Path

import cv2
import numpy as np

NAME = "shift_map"


def main(cases: Path, out: Path) -> dict[str, list[float]]:
    seconds = []
    for path in sorted(cases.glob("*.image.png")):
        case = path.name.removesuffix(".image.png")
        image = cv2.imread(str(path))
        mask = cv2.imread(str(cases / f"{case}.mask.png"), cv2.IMREAD_GRAYSCALE)
        cv2.setRNGSeed(0)
        start = time.perf_counter()
        lab, filled = cv2.cvtColor(image, cv2.COLOR_BGR2Lab), np.zeros_like(image)
        cv2.xphoto.inpaint(lab, 255 - mask, filled, cv2.xphoto.INPAINT_SHIFTMAP)
        filled = cv2.cvtColor(filled, cv2.COLOR_Lab2BGR)
        seconds.append(time.perf_counter() - start)
        cv2.imwrite(str(out / f"{case}.{NAME}.png"), np.where(mask[..., None] > 0, filled, image))
    return {NAME: seconds}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]))))
