"""Variation hierarchies of real facades: levels, types, bytes, fidelity and seconds, as JSON."""

from __future__ import annotations

import io
import json
import os
import time
from collections import Counter
from pathlib import Path

import numpy as np
from PIL import Image

from facade_core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.types import Element
from facade_core.variation import encode


def elements_of(labels: np.ndarray, *, smallest: int = 40) -> list[Element]:
    """Boxes of the connected components of window, balcony, door and shop with at least `smallest` pixels."""
    from skimage.measure import label, regionprops

    found = []
    for name in ELEMENT_CLASSES:
        for region in regionprops(label(labels == CLASSES.index(name))):
            y0, x0, y1, x1 = region.bbox
            if region.area >= smallest and min(y1 - y0, x1 - x0) >= 4:
                found.append(Element(name, x0, y0, x1, y1))
    return found


def psnr(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB over the pixels of a mask."""
    error = ((a[mask].astype(float) - b[mask]) ** 2).mean()
    return float(10 * np.log10(255**2 / max(error, 1e-9)))


def coded_size(image: np.ndarray, form: str, **options: int) -> int:
    """Bytes of the image in another format."""
    out = io.BytesIO()
    Image.fromarray(image).save(out, form, **options)
    return len(out.getvalue())


def run(folder: Path, *, every: int = 4) -> dict[str, object]:
    """Figures over every n-th facade of a folder with images/ and labels/ (ids as in CLASSES)."""
    rows = []
    for path in sorted((folder / "images").iterdir())[::every]:
        image = np.asarray(Image.open(path).convert("RGB"))
        elements = elements_of(np.asarray(Image.open(folder / "labels" / f"{path.stem}.png")))
        encode(image, elements)
        start = time.perf_counter()
        hierarchy = encode(image, elements)
        seconds = time.perf_counter() - start
        mask = np.zeros(image.shape[:2], bool)
        for e in elements:
            mask[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] = True
        first = hierarchy.reconstruct(0)
        rows.append(
            {
                "facade": path.stem,
                "elements": len(elements),
                "levels": len(hierarchy.levels),
                "types": len(hierarchy.representatives),
                "bytes": hierarchy.nbytes,
                "png": coded_size(image, "PNG"),
                "jpeg75": coded_size(image, "JPEG", quality=75),
                "webp75": coded_size(image, "WEBP", quality=75),
                "psnr elements": round(psnr(image, first, mask), 2),
                "psnr all": round(psnr(image, first, np.ones_like(mask)), 2),
                "seconds": round(seconds, 3),
            }
        )
    keys = [k for k in rows[0] if k != "facade"]
    median = {k: round(float(np.median([float(str(r[k])) for r in rows])), 3) for k in keys}
    histogram = {str(k): v for k, v in sorted(Counter(int(str(r["levels"])) for r in rows).items())}
    return {"facades": len(rows), "median": median, "facades by number of levels": histogram, "each": rows}


def main() -> None:
    """Print the report for facades of ECP, elements from the true labels."""
    data = Path(os.environ.get("STREETLOOM_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    print(json.dumps({"ecp": run(data / "facades" / "ecp")}, indent=1))


if __name__ == "__main__":
    main()
