"""A street of a run by day and by night, as three.js lights it: docs/light-day.jpg and docs/light-night.jpg.

    python -m benchmarks.light out/demo --view street-0

exports the run as a lit GLB and opens it in Chromium, on a software renderer, from where one of the report's pictures is taken.
The sun stands where the block's does; by night the moon does. Needs `make clients`, and Chromium or Playwright's own.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.programs import CHROMIUM, PACKAGES, chromium, served
from facade_core.core.types import Sun
from facade_core.export.models.textured_mesh import mesh_y_up_frame, to_y_up
from facade_core.export.pictures.views import choose_cameras, view_names
from facade_core.street.lighting.sun import sun_direction
from tasks.export.formats import export_run
from tasks.export.lighting import relighting_inputs
from tasks.publish.published_run import open_published_run

HERE = Path(__file__).resolve().parent
SIZE = (1280, 640)
# Where a block states none.
NOON = Sun(145.0, 47.0)


def main() -> None:
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="the folder of a run that is published")
    parser.add_argument("--view", default="street-0", help="one of the report's views")
    parser.add_argument("--glb", type=Path, help="folder of a lit export of the run, made before")
    parser.add_argument("--to", type=Path, default=Path("docs"), help="folder of the pictures")
    asked = parser.parse_args()
    if CHROMIUM is None or not (PACKAGES / "three").is_dir():
        parser.error("Chromium and three.js draw it; install chromium, and run `make clients`")
    with open_published_run(asked.out) as found:
        view = dict(zip(view_names(found.plan), choose_cameras(found.plan, found.records), strict=True))[asked.view]
        frame = mesh_y_up_frame(found.plan.scene.mesh)
        light = relighting_inputs(found).light
        sun = (light and light.sun) or NOON
    eye, target = frame.points(np.array([view.position, view.target]))
    seen = {
        "eye": eye.tolist(),
        "target": target.tolist(),
        "up": 48,
        "sun": to_y_up(sun_direction(sun)[None])[0].tolist(),
    }
    seen |= {"width": SIZE[0], "height": SIZE[1]}
    told: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = asked.glb or Path(str(export_run(asked.out, "glb", Path(scratch) / "glb").path))
        told["glb_mb"] = round((folder / "block.glb").stat().st_size / 1e6, 1)
        places = {"pages": HERE, "model": folder, "three": PACKAGES / "three"}
        with served(**places) as address, sync_playwright() as playwright, chromium(playwright) as browser:
            for name in ("day", "night"):
                page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
                page.set_default_timeout(600_000)
                page.on("pageerror", print)
                page.on("console", lambda line: print(line.text) if line.type == "error" else None)
                start = time.monotonic()
                page.goto(f"{address}/pages/light.html")
                page.wait_for_function("window.ready")
                told[f"{name}_primitives_of_variants"] = page.evaluate("picture", seen | {"night": name == "night"})
                data = page.evaluate("document.querySelector('canvas').toDataURL('image/png')")
                image = Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB")
                image.save(asked.to / f"light-{name}.jpg", quality=86)
                told[f"{name}_seconds"] = round(time.monotonic() - start, 1)
                page.close()
    print(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
