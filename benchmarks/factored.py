"""A factored model beside one with unique texels: `python -m benchmarks.factored OUT` prints JSON of both.

Bytes, textures with their mipmaps on a graphics card, triangles, draw calls, seconds a building, texels per metre of elements.
With --sheet FILE a picture of both, from 3, 15 and 40 m before facades (--facade, several times), by three.js in Chromium
(`make clients`).
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from benchmarks.programs import CHROMIUM, PACKAGES, chromium, served
from facade_core.export.models.glb import read_glb_header
from facade_core.export.models.textured_mesh import mesh_y_up_frame
from tasks.export.formats import export_run
from tasks.publish.published_run import open_published_run

METRES = (3.0, 15.0, 40.0)
SIZE = (760, 500)
MIPMAPS = 4 / 3


def measure(path: Path) -> dict[str, Any]:
    """Of a GLB."""
    with path.open("rb") as file:
        document, start = read_glb_header(file)
        texels, pictures = 0, 0
        for image in document["images"]:
            view = document["bufferViews"][image["bufferView"]]
            file.seek(start + view.get("byteOffset", 0))
            width, height = Image.open(io.BytesIO(file.read(view["byteLength"]))).size
            texels, pictures = texels + width * height, pictures + view["byteLength"]
    primitives = [primitive for mesh in document["meshes"] for primitive in mesh["primitives"]]
    return {
        "mb": round(path.stat().st_size / 1e6, 2),
        "pictures_mb": round(pictures / 1e6, 2),
        "texture_mb": round(texels * 4 * MIPMAPS / 1e6, 1),
        "triangles": sum(document["accessors"][one["indices"]]["count"] // 3 for one in primitives),
        "draw_calls": len(primitives),
        "nodes": len(document["nodes"]),
    }


def cameras(out: Path, wanted: Sequence[str]) -> list[tuple[str, float, list[float], list[float]]]:
    """Facade, metres before it, eye and target in the models' frame: those named, else the largest on streets that are made
    from an exemplar and from a photo."""
    with open_published_run(out) as found:
        plan, scene = found.plan, found.plan.scene
        facades, charts = plan.facades, scene.charts
        frame = mesh_y_up_frame(scene.mesh)
        names = list(facades.id)
        if wanted:
            chosen = [names.index(name) for name in wanted]
        else:
            area = facades.width * facades.height * (facades.role == 0)
            order = np.argsort(-area, kind="stable").tolist()
            made = {i: str((found.records[i] or {}).get("source")) for i in order}
            chosen = [
                next(i for i in order if "." not in made[i]),
                next((i for i in order if "." in made[i]), order[0]),
            ]
        views = []
        for i in chosen:
            chart = int(facades.chart[i])
            width, height = charts.size[chart]
            for metres in METRES:
                up = height - min(2.6 if metres < 5 else 4.5, height / 2)
                target = charts.points(chart, np.array([width / 2]), np.array([up]))[0]
                foot = charts.points(chart, np.array([width / 2]), np.array([height]))[0]
                turn = 0.35 * charts.axis_u[chart]
                eye = target + metres * (charts.normals()[chart] + turn) / np.linalg.norm(
                    charts.normals()[chart] + turn
                )
                eye[2] = foot[2] + 1.7
                to_eye = eye - target
                depth, _ = scene.caster.cast(
                    target + 0.3 * charts.normals()[chart], (to_eye / np.linalg.norm(to_eye))[None]
                )
                if depth[0] < metres:  # a house stands between
                    eye = target + 0.9 * float(depth[0]) * to_eye / np.linalg.norm(to_eye)
                eye_at, target_at = frame.points(np.stack([eye, target])).tolist()
                views.append((names[i], float(np.linalg.norm(eye - target)), eye_at, target_at))
        return views


def rendered(folder: Path, views: Sequence[tuple[str, float, list[float], list[float]]]) -> list[Image.Image]:
    """block.glb of a folder from some places, by three.js."""
    from playwright.sync_api import sync_playwright

    if CHROMIUM is None or not (PACKAGES / "three").is_dir():
        raise SystemExit("--sheet: Chromium and three.js draw it; install chromium, and run `make clients`")
    places = {"pages": Path(__file__).resolve().parent, "three": PACKAGES / "three", "model": folder}
    with served(**places) as address, sync_playwright() as playwright, chromium(playwright) as browser:
        tab = browser.new_page()
        tab.goto(f"{address}/pages/factored.html?size={SIZE[0]},{SIZE[1]}")
        tab.wait_for_function("window.ready || window.failed", timeout=300_000)
        if failed := tab.evaluate("window.failed"):
            raise SystemExit(f"three.js: {failed}")
        found = []
        for _, _, eye, target in views:
            url = tab.evaluate("([eye, target]) => window.draw(eye, target)", [eye, target])
            found.append(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB"))
    return found


def sheet(pairs: Sequence[tuple[str, Image.Image, Image.Image]]) -> Image.Image:
    """Rows of unique texels at the left and factored at the right."""
    drawn = Image.new("RGB", (2 * SIZE[0] + 4, len(pairs) * (SIZE[1] + 4)), "white")
    for row, (title, *images) in enumerate(pairs):
        for column, (image, name) in enumerate(zip(images, ("unique texels", "factored"), strict=True)):
            place = (column * (SIZE[0] + 4), row * (SIZE[1] + 4))
            drawn.paste(image, place)
            where = (place[0] + 8, place[1] + 6)
            ImageDraw.Draw(drawn).text(where, f"{name}, {title}", fill="white", stroke_width=2, stroke_fill="black")
    return drawn


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("out", type=Path, help="the folder of a finished run")
    parser.add_argument("--sheet", type=Path, help="where to draw both, as JPEG")
    parser.add_argument("--facade", action="append", default=[], help="before which facades, by id")
    options = parser.parse_args()
    told: dict[str, Any] = {"benchmark": "factored"}
    with tempfile.TemporaryDirectory() as scratch:
        folders = {}
        for name, textures in (("unique", None), ("factored", "factored")):
            start = time.monotonic()
            made = export_run(
                options.out, "glb", Path(scratch) / name, textures=textures, lit=None if textures else False
            )
            seconds = time.monotonic() - start
            folders[name] = Path(str(made.path))
            told[name] = measure(folders[name] / "block.glb")
            told[name]["seconds_a_building"] = round(seconds / max(told[name]["nodes"] - 1, 1), 2)
        told["factored"] |= json.loads((folders["factored"] / "figures.json").read_text())
        if options.sheet:
            views = cameras(options.out, options.facade)
            both = [rendered(folders[name], views) for name in ("unique", "factored")]
            titles = [f"{name} from {metres:.0f} m" for name, metres, _, _ in views]
            sheet(list(zip(titles, *both, strict=True))).save(options.sheet, quality=88)
            told["colour_apart"] = {
                title: round(float(np.abs(_small(a) - _small(b)).mean()), 1)
                for title, a, b in zip(titles, *both, strict=True)
            }
    print(json.dumps(told, indent=1))


def _small(image: Image.Image) -> np.ndarray:
    """A picture meant over an eighth of its width, grey levels."""
    return np.asarray(image.resize((8, 5), Image.Resampling.BOX)).astype(float)


if __name__ == "__main__":
    main()
