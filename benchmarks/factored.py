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
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from facade_core.export.glb import header_of
from facade_core.export.models import local_frame
from tasks.export.formats import export
from tasks.published.opened import published

METRES = (3.0, 15.0, 40.0)
SIZE = (760, 500)
MIPMAPS = 4 / 3
CLIENTS = Path(__file__).resolve().parents[1] / ".venv" / "clients" / "node_modules"
PAGE = """<!doctype html><meta charset="utf-8">
<script type="importmap">{"imports": {"three": "/three/build/three.module.js"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "/three/examples/jsm/loaders/GLTFLoader.js";
const renderer = new THREE.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
renderer.setSize(WIDTH, HEIGHT);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xb9c6d2);
new GLTFLoader().load("/model/block.glb", (gltf) => {
  scene.add(gltf.scene);
  gltf.scene.traverse((one) => { if (one.material?.map) one.material.map.anisotropy = 8; });
  window.draw = (eye, target) => {
    const camera = new THREE.PerspectiveCamera(50, WIDTH / HEIGHT, 0.1, 2000);
    camera.position.set(...eye); camera.lookAt(...target);
    renderer.render(scene, camera);
    return renderer.domElement.toDataURL("image/png");
  };
  window.ready = true;
}, undefined, (error) => { window.failed = String(error); });
</script>"""


def measure(path: Path) -> dict[str, Any]:
    """Of a GLB."""
    with path.open("rb") as file:
        document, start = header_of(file)
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
    with published(out) as found:
        plan, scene = found.plan, found.plan.scene
        facades, charts = plan.facades, scene.charts
        frame = local_frame(scene.mesh)
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
                eye = target + metres * (charts.normal()[chart] + turn) / np.linalg.norm(charts.normal()[chart] + turn)
                eye[2] = foot[2] + 1.7
                to_eye = eye - target
                depth, _ = scene.caster.cast(
                    target + 0.3 * charts.normal()[chart], (to_eye / np.linalg.norm(to_eye))[None]
                )
                if depth[0] < metres:  # a house stands between
                    eye = target + 0.9 * float(depth[0]) * to_eye / np.linalg.norm(to_eye)
                eye_at, target_at = frame.points(np.stack([eye, target])).tolist()
                views.append((names[i], float(np.linalg.norm(eye - target)), eye_at, target_at))
        return views


@contextmanager
def served(folders: dict[str, Path], page: str) -> Iterator[str]:
    class Files(SimpleHTTPRequestHandler):
        def do_GET(self) -> None:
            _, name, rest = (self.path.split("?")[0] + "//").split("/", 2)
            path = folders.get(name, Path("/nowhere")) / rest.rstrip("/")
            data = page.encode() if name == "page" else path.read_bytes() if path.is_file() else None
            self.send_response(200 if data is not None else 404)
            kind = {"page": "text/html", ".js": "text/javascript"}.get(name if name == "page" else path.suffix)
            self.send_header("Content-Type", kind or "application/octet-stream")
            self.end_headers()
            self.wfile.write(data or b"")

        def log_message(self, format: str, *arguments: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Files))
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()


def rendered(folder: Path, views: Sequence[tuple[str, float, list[float], list[float]]]) -> list[Image.Image]:
    """block.glb of a folder from some places, by three.js."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None or not (CLIENTS / "three").is_dir():
        raise SystemExit("--sheet: Chromium and three.js draw it; install chromium, and run `make clients`")
    page = PAGE.replace("WIDTH", str(SIZE[0])).replace("HEIGHT", str(SIZE[1]))
    flags = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with served({"three": CLIENTS / "three", "model": folder}, page) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=[*flags, "--ignore-gpu-blocklist"])
        tab = browser.new_page()
        tab.goto(f"{address}/page/")
        tab.wait_for_function("window.ready || window.failed", timeout=300_000)
        if failed := tab.evaluate("window.failed"):
            raise SystemExit(f"three.js: {failed}")
        found = []
        for _, _, eye, target in views:
            url = tab.evaluate("([eye, target]) => window.draw(eye, target)", [eye, target])
            found.append(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB"))
        browser.close()
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
            made = export(options.out, "glb", Path(scratch) / name, textures=textures, lit=None if textures else False)
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
