"""The pictures of README's first screen, and the page with a slider between them: a street of a run, bare and textured.

    python -m benchmarks.first_screen out/demo --view street-1

writes docs/street.jpg, docs/street-bare.jpg and docs/street.html. Bare is the geometry in the light that the block has.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from facade_core.export.pictures.rendering import encode_image, render_perspective
from facade_core.export.pictures.views import choose_cameras, view_names
from facade_core.geometry.scene import Scene
from facade_core.street.propagation.render import daylight_grey
from tasks.publish.published_run import open_published_run

# Grey of bare geometry, as a share of white.
BARE = 0.86
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>A street before and after</title>
<style>
body { margin: 0; font: 16px/1.4 system-ui, sans-serif; background: #1d2329; color: #fff; text-align: center; }
div { position: relative; width: min(100vw, 160vh); margin: 0 auto; --share: 50%; }
img { display: block; width: 100%; }
img + img { position: absolute; inset: 0; clip-path: inset(0 calc(100% - var(--share)) 0 0); }
i { position: absolute; inset: 0 auto 0 var(--share); width: 3px; margin-left: -1px; background: #fff; }
input { position: absolute; inset: 0; width: 100%; height: 100%; margin: 0; opacity: 0; cursor: ew-resize; }
</style>
<div>
<img src="street.jpg" alt="The street as Streetloom textures it">
<img src="street-bare.jpg" alt="The same street as it was given">
<i></i><input type="range" value="50" step="0.1" aria-label="How much of the picture is bare">
</div>
<p>Drag: left as given, right as textured.</p>
<script>
const page = document.querySelector("div");
const drag = (event) => page.style.setProperty("--share", `${event.target.value}%`);
document.querySelector("input").addEventListener("input", drag);
</script>
</html>
"""


def bare(scene: Scene, chart: int) -> np.ndarray:
    """The raster (h, w, 3) uint8 of a chart of nothing but geometry: grey by its slope and the sky that it sees."""
    import cv2

    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    normal, daylight = scene.charts.normals()[chart], scene.daylight
    daylight.compute([chart])
    rows, columns, first = int(daylight.rows[chart]), int(daylight.columns[chart]), int(daylight.start[chart])
    light = cv2.resize(daylight.light[first : first + rows * columns].reshape(rows, columns), (width, height))
    grey = 255 * BARE * float(daylight_grey(normal)) * light.reshape(height, width)
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="the folder of a run that is published")
    parser.add_argument("--view", default="street-0", help="one of the report's views")
    parser.add_argument("--to", type=Path, default=Path("docs"), help="folder of the files")
    asked = parser.parse_args()
    with open_published_run(asked.out) as found:
        views = dict(zip(view_names(found.plan), choose_cameras(found.plan, found.records), strict=True))
        if asked.view not in views:
            parser.error(f"--view {asked.view}: there are {', '.join(views)}")
        scene, camera = found.plan.scene, views[asked.view]
        for name, raster in (("street", found.textured_mesh.raster), ("street-bare", lambda chart: bare(scene, chart))):
            rgb = render_perspective(scene, camera, raster)
            (asked.to / f"{name}.jpg").write_bytes(encode_image(rgb, "JPEG", quality=84))
    (asked.to / "street.html").write_text(PAGE, "utf-8")


if __name__ == "__main__":
    main()
