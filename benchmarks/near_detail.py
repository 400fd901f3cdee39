"""How sharp the elements of walls are from 5 m, without and with the element pictures of 3D Tiles.

`streetloom bench near_detail --out DIR --data DIR` prints JSON: squared gradients of the walls' brightness over its squared
mean, as a share of that of walls in held-out panoramas (`streetloom bench look --only detail`), from the pavement before
facades with element pictures; elements with a picture, and texels per metre of both. --sheet FILE draws the first views,
without at the left.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.look.likeness import real_energy, relative_energy, rendered_energy
from benchmarks.look.outputs import read_output
from benchmarks.look.views import SAMPLES, SIZE, View, near_cameras, view_of_picture
from facade_core.core.linear_light import linear_to_srgb, srgb_to_linear
from facade_core.export.factored.library import FacadeLibrary
from facade_core.export.factored.wall_geometry import WallPieces
from facade_core.export.pictures.rendering import cast_view
from facade_core.geometry.charts import Charts
from tasks.export.element_pictures import place_pictures
from tasks.publish.published_run import open_published_run

VIEWS = 40
SHOWN = 8
# Walls are drawn at this multiple of their texels, that of a picture of 64 texels per metre on a wall of 32.
TIMES = 2


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="streetloom bench near_detail", description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of a run that has published")
    parser.add_argument(
        "--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")), help="real data"
    )
    parser.add_argument("--sheet", type=Path, help="where the first views are drawn")
    parser.add_argument("--seed", type=int, default=24, help="of where the views are taken")
    options = parser.parse_args()
    print(json.dumps(measure(options.out, options.data, options.sheet, options.seed), indent=1))


def measure(out: Path, data: Path, sheet: Path | None, seed: int) -> dict[str, Any]:
    """The figures of a run."""
    output = read_output(out)
    cameras = [place[0] for place in near_cameras([output], VIEWS, seed)]
    pictures = [(cast_view(output.scene, camera, samples=SAMPLES), camera) for camera in cameras]
    energies: dict[str, list[Any]] = {"without": [], "with": []}
    shown: dict[str, list[np.ndarray]] = {"without": [], "with": []}
    with open_published_run(out) as results:
        pieces_of, libraries = place_pictures(results, results.select_buildings(()))
        of_chart = _by_chart(pieces_of)
        for picture, camera in pictures:
            plain = {chart: results.textured_mesh.raster(chart) for chart in picture.visible_charts.tolist()}
            rich = {
                chart: _composed(raster, of_chart[chart], libraries, results.textured_mesh.charts, chart, output)
                for chart, raster in plain.items()
                if chart in of_chart
            }
            for name, rasters in (("without", plain), ("with", plain | rich)):
                picture.paint(rasters)
                view: View = view_of_picture(camera, picture)
                energies[name].append(rendered_energy(view, output.charts, output.walls))
                if len(shown[name]) < SHOWN:
                    shown[name].append(view.rgb)
    real = relative_energy(real_energy(data))
    found: dict[str, Any] = {"benchmark": "near_detail", "views": len(cameras), "size": SIZE}
    for name, parts in energies.items():
        value, pixels = relative_energy(parts)[5.0]
        found[name] = {"of_photos": round((value or 0) / (real[5.0][0] or 1), 3), "pixels": pixels}
    dense = [density for pieces in pieces_of.values() for _, density in pieces.elements]
    found["elements_with_picture"] = len(dense)
    found["texels_per_metre"] = np.percentile(dense or [0], (5, 50, 95)).round(1).tolist()
    if sheet:
        from PIL import Image

        rows = [np.hstack([*pair]) for pair in zip(shown["without"], shown["with"], strict=True)]
        Image.fromarray(np.vstack(rows)).save(sheet)
    return found


def _by_chart(pieces_of: Mapping[int, WallPieces]) -> dict[int, list[Any]]:
    found: dict[int, list[Any]] = {}
    for pieces in pieces_of.values():
        for key, own in pieces.by_picture.items():
            for piece in own:
                found.setdefault(piece.chart, []).append((key, piece))
    return found


def _composed(
    raster: np.ndarray, pieces: list[Any], libraries: list[FacadeLibrary], charts: Charts, chart: int, output: Any
) -> np.ndarray:
    """A wall's raster at TIMES its texels, with its element pictures over it."""
    import cv2

    drawn = cv2.resize(raster, None, fx=TIMES, fy=TIMES, interpolation=cv2.INTER_LINEAR)
    density = TIMES * float(output.placement.texels_per_metre[chart])
    for (_, library, number), piece in pieces:
        away = piece.position - charts.origin[chart]
        place = np.stack([away @ charts.axis_u[chart], away @ charts.axis_v[chart]], axis=-1) * density
        (x0, y0), (x1, y1) = place.min(axis=0).round().astype(int), place.max(axis=0).round().astype(int)
        picture = cv2.resize(libraries[library].types[number].picture, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
        columns = len(np.unique(piece.place[:, 0].round(6)))
        across, down = np.meshgrid(
            np.linspace(0, columns - 1, x1 - x0), np.linspace(0, len(piece.light) // columns - 1, y1 - y0)
        )
        light = cv2.remap(
            np.ascontiguousarray(piece.light.reshape(-1, columns, 3), np.float32),
            across.astype(np.float32),
            down.astype(np.float32),
            cv2.INTER_LINEAR,
        )
        part = drawn[max(y0, 0) : y1, max(x0, 0) : x1]
        part[:] = linear_to_srgb(srgb_to_linear(picture) * light)[: part.shape[0], : part.shape[1]]
    return np.asarray(drawn)


if __name__ == "__main__":
    main()
