"""Painted facades beside real ones: `python -m benchmarks.painting --data DIR` prints JSON.

painted: of the demo's style library, as `tasks.examples.paint_demo` paints it; the others: rectified photos with labels (ecp,
cmp and artdeco; for evaluation only, as here). brightness and saturation: of a wall's median pixel, tenth, half and nine
tenths of the facades; panes: grey of windows, by share of their pixels, median over facades; contrast: deviation of walls' and
windows' grey over its mean. detail: squared gradients of brightness over its squared mean above 2.5 m as a camera of
`streetloom bench look` would show them at 45 degrees, as a share of the same of walls in held-out panoramas, at densities of
texels a metre. stains: deviations of plain wall in bands of .7 and 2.6 m at a quarter, half and three fourths of the facades;
the median window of a photograph is held for 1.2 m wide, as nothing tells its scale. seconds: of the processor, to paint one
facade (median) and the library.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.look.likeness import DISTANCES, FREE_M, gradient_energy, real_energy, relative_energy
from benchmarks.look.photos import read_picture
from benchmarks.look.views import FIELD_OF_VIEW, SIZE
from facade_core.core.labels import FacadeClass
from facade_core.street.materials.stains import BANDS_M, wall_brightness_deviations
from facade_core.synth.exemplars import paint_exemplar
from facade_core.synth.facade import PaintedFacade
from facade_core.synth.styles import NORDIC_STYLES
from tasks.examples.demo import SEED
from tasks.examples.paint_demo import EXEMPLAR_PIXELS_PER_METRE, EXEMPLARS

DENSITIES = (64, 32, 16)
# Of the sets in DATA/facades: ids of wall and window.
REAL = {"ecp": (0, 1), "cmp": (2, 3), "artdeco": (0, 1)}
# How wide the median window of a photograph is held to be, and how many windows tell that, at least.
WINDOW_M, LEAST_WINDOWS = 1.2, 5
_FOCAL = SIZE[1] / 2 / np.tan(np.radians(FIELD_OF_VIEW / 2))
_GREY = np.array([0.299, 0.587, 0.114])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.painting", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder of real data",
    )
    parser.add_argument("--count", type=int, default=EXEMPLARS, help="facades to paint, all without")
    options = parser.parse_args()
    facades, seconds = [], []
    for number in range(options.count):
        start = time.process_time()
        facades.append(
            paint_exemplar(number, seed=SEED, metres_per_pixel=1 / EXEMPLAR_PIXELS_PER_METRE, styles=NORDIC_STYLES)
        )
        seconds.append(time.process_time() - start)
    figures: dict[str, Any] = {
        "benchmark": "painting",
        "painted": _tones((f.image, f.labels == FacadeClass.WALL, f.labels == FacadeClass.WINDOW) for f in facades),
    }
    figures |= {name: _tones(_real(options.data / "facades" / name, *ids)) for name, ids in REAL.items()}
    figures["stains"] = {
        "painted": _stains((f.image, f.labels == FacadeClass.WALL, EXEMPLAR_PIXELS_PER_METRE) for f in facades)
    } | {name: _stains(_scaled(_real(options.data / "facades" / name, *ids))) for name, ids in REAL.items()}
    figures["detail"] = _detail(facades, options.data)
    figures["seconds"] = {"one": round(float(np.median(seconds)), 3), "all": round(sum(seconds), 1)}
    print(json.dumps(figures, indent=1))


def _real(folder: Path, wall: int, window: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pictures (h, w, 3) of a set with where they show walls and windows (h, w)."""
    for path in sorted((folder / "images").glob("*")):
        image = read_picture(path)
        labels = cv2.imread(str(folder / "labels" / f"{path.stem}.png"), cv2.IMREAD_UNCHANGED)
        if labels is not None and labels.shape == image.shape[:2]:
            yield image, labels == wall, labels == window


def _tones(facades: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> dict[str, Any]:
    rows = []
    for image, wall, window in facades:
        if not (wall.any() and window.any()):
            continue
        grey = image @ _GREY
        colour = np.median(image[wall], axis=0)
        both = grey[wall | window]
        shares = np.percentile(grey[window], (10, 25, 50, 75))
        rows.append([colour @ _GREY, 1 - colour.min() / max(colour.max(), 1), *shares, both.std() / both.mean()])
    table = np.array(rows)
    spread = np.percentile(table[:, :2], (10, 50, 90), axis=0)
    return {
        "facades": len(rows),
        "brightness_of_walls": spread[:, 0].round().tolist(),
        "saturation_of_walls": spread[:, 1].round(2).tolist(),
        "panes_10_25_50_75": np.median(table[:, 2:6], axis=0).round().tolist(),
        "contrast": round(float(np.median(table[:, 6])), 2),
    }


def _scaled(
    facades: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Pictures and walls, with pixels to the metre by the width of their windows."""
    for image, wall, window in facades:
        _, _, boxes, _ = cv2.connectedComponentsWithStats(window.astype(np.uint8))
        if len(boxes) > LEAST_WINDOWS:
            yield image, wall, float(np.median(boxes[1:, cv2.CC_STAT_WIDTH])) / WINDOW_M


def _stains(facades: Iterable[tuple[np.ndarray, np.ndarray, float]]) -> dict[str, list[float]]:
    """By wavelength, at a quarter, half and three fourths of the facades that have enough plain wall."""
    every = [
        wall_brightness_deviations((image @ _GREY).astype(np.uint8), wall, density) for image, wall, density in facades
    ]
    found = np.array([one for one in every if one is not None])
    return {f"{band:g} m": np.percentile(found[:, k], (25, 50, 75)).round(4).tolist() for k, band in enumerate(BANDS_M)}


def _detail(facades: list[PaintedFacade], data: Path) -> dict[str, dict[str, float]]:
    real = relative_energy(real_energy(data))
    found: dict[str, dict[str, float]] = {}
    for density in DENSITIES:
        parts = [_energy(facade, density) for facade in facades]
        ours = relative_energy(parts)
        found[f"{density} a metre"] = {
            f"{metres:g} m": round((ours[metres][0] or 0) / (real[metres][0] or np.inf), 3) for metres in DISTANCES
        }
    return found


def _energy(facade: PaintedFacade, density: float) -> dict[float, tuple[float, float, int]]:
    """As `gradient_energy`, of the facade at every one of its distances in turn."""
    share = density * facade.metres_per_pixel
    texels = cv2.resize(facade.image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    found = {}
    for metres in DISTANCES:
        scale = _FOCAL / metres / density
        method = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        seen = cv2.resize(texels, None, fx=scale * np.sqrt(0.5), fy=scale, interpolation=method)
        seen = seen[: max(2, round(len(seen) - FREE_M * scale * density))]
        shape = seen.shape[:2]
        found[metres] = gradient_energy(seen, np.full(shape, metres), np.ones(shape, bool))[metres]
    return found


if __name__ == "__main__":
    main()
