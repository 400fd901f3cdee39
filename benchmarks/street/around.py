"""Views of a run without and with its objects and neighbours, drawn as the report draws its own.

python -m benchmarks.street.around OUT [--without OTHER] [--pairs FOLDER --key FILE] [--sheet FILE]

--without: views of another run of the block in place of those without, both with what stands around, as of `light: false`.

--pairs: numbered pairs, without to the left or right by chance; the key says which. --sheet: some, without to the left.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from benchmarks.blind_pairs import PAIRS
from benchmarks.look.outputs import read_output
from benchmarks.look.views import shows_street, standing
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import cast_smooth_view
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.export.pictures.surroundings import SurroundingView
from facade_core.export.pictures.views import paint_view
from facade_core.geometry.streets import Viewpoint
from tasks.publish.published_run import PublishedBlock, open_published_run

SEED, SIZE, GAP = 75, (540, 810), 12
# Degrees between a street and a camera that looks along it.
TURNED = 15.0
# Pairs from above, their height over the street and how far ahead they look, metres.
FROM_ABOVE, ABOVE_M, AHEAD_M = 6, 24.0, 45.0
# Pairs on the sheet: trees, neighbours, and both from above.
ON_SHEET, SHEET_WIDTH = (11, 13, 20, 22), 900


def choose_cameras(out: Path, viewpoints: Sequence[Viewpoint]) -> list[PerspectiveCamera]:
    """Return cameras at eye height that look along the streets of a run by chance, and some higher up."""
    output, rng = read_output(out), np.random.default_rng(SEED)
    found: list[PerspectiveCamera] = []
    for place in rng.permutation(len(viewpoints)).tolist():
        forward = viewpoints[place].forward * rng.choice([-1, 1])
        heading = np.arctan2(forward[1], forward[0]) + np.radians(rng.uniform(-TURNED, TURNED))
        camera = standing(output, viewpoints[place].position[:2], heading)
        if camera is not None and shows_street(output, camera) and len(found) < PAIRS:
            found.append(replace(camera, size=SIZE))
    return [*found[FROM_ABOVE:], *map(_raise_camera, found[:FROM_ABOVE])]


def _raise_camera(camera: PerspectiveCamera) -> PerspectiveCamera:
    ahead = (camera.target - camera.position) * [1, 1, 0]
    position = camera.position + np.array([0, 0, ABOVE_M])
    return replace(camera, position=position, target=camera.position + ahead * AHEAD_M)


def draw_pairs(
    results: PublishedBlock, cameras: Sequence[PerspectiveCamera], other: PublishedBlock | None = None
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the views (h, w, 3) of each camera without and with what stands around; or of another run and with it."""
    plan = results.plan
    around = SurroundingView(plan.objects, plan.surroundings)
    for camera in cameras:
        views = []
        for run, shown in ((other or results, around if other else None), (results, around)):
            picture = cast_smooth_view(plan.scene, camera, samples=BLOCK_VIEWS.samples_per_pixel_side, around=shown)
            rasters = ({chart: run.textured_mesh.raster(chart)} for chart in picture.visible_charts.tolist())
            views.append(paint_view(picture, chain(rasters)))
        yield views[0], views[1]


def join_pair(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return two views side by side."""
    return np.concatenate([left, np.full((len(left), GAP, 3), 255, np.uint8), right], axis=1)


def main() -> None:
    """Draw pairs of views."""
    from PIL import Image

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--without", type=Path, metavar="OTHER")
    parser.add_argument("--pairs", type=Path)
    parser.add_argument("--key", type=Path)
    parser.add_argument("--sheet", type=Path)
    options = parser.parse_args()
    with ExitStack() as stack:
        results = stack.enter_context(open_published_run(options.out))
        other = stack.enter_context(open_published_run(options.without)) if options.without else None
        cameras = choose_cameras(options.out, results.plan.viewpoints)
        if options.sheet:
            shown = draw_pairs(results, [cameras[number] for number in ON_SHEET], other)
            drawn = Image.fromarray(np.concatenate([join_pair(*pair) for pair in shown]))
            drawn.resize((SHEET_WIDTH, round(drawn.height * SHEET_WIDTH / drawn.width))).save(
                options.sheet, quality=78, optimize=True
            )
        elif options.pairs:
            options.pairs.mkdir(parents=True, exist_ok=True)
            is_turned = np.random.default_rng([SEED, other is not None]).random(PAIRS) < 0.5
            pairs = draw_pairs(results, cameras, other)
            for number, (pair, turn) in enumerate(zip(pairs, is_turned, strict=True), 1):
                Image.fromarray(join_pair(*(pair[::-1] if turn else pair))).save(options.pairs / f"{number:02}.png")
            lines = [
                f"{number:02} with on the {'left' if turn else 'right'}" for number, turn in enumerate(is_turned, 1)
            ]
            options.key.write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main()
