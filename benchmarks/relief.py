"""A model with elements in depth beside the flat one: `python -m benchmarks.relief OUT` prints JSON.

Elements and those in depth; triangles an element; bytes of the unlit and of the lit GLB over the flat one's; processor seconds;
share of texels that differ by more than 2 from the front. With --sheet FILE views of both, at 20 to 60 degrees to a wall.

`python -m benchmarks.relief OUT OUT ... --pairs DIR` draws 24 blind pairs of views of all outputs instead, to be judged and
counted as those of `streetloom bench blind_pairs`.
"""

from __future__ import annotations

import argparse
import io
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from benchmarks.blind_answers import write_key
from benchmarks.blind_pairs import PAIRS, sheet
from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.types import Element
from facade_core.export.bodies.textured_relief import add_relief
from facade_core.export.models.encoders import ENCODERS
from facade_core.export.models.glb import encode_glb
from facade_core.export.models.gltf_materials import encode_textures
from facade_core.export.models.textured_mesh import (
    TexturedMesh,
    build_nodes,
    draw_page_images,
    mesh_y_up_frame,
    pack_charts_on_pages,
)
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import average_samples
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.street.lighting.sky import backdrop_colour
from tasks.export.models import mesh_with_requested_lighting
from tasks.export.relief import OFF, facade_elements
from tasks.publish.published_run import PublishedBlock, open_published_run

IN_DEPTH = ("window", "door", "shop", "balcony")
MAX_FRONT_DIFFERENCE = 2
# Walls are flat within less than this, and no element is shallower.
MIN_OFFSET_M = 0.03
# Degrees to the wall and metres from it.
VIEWS = ((20, 4), (20, 8), (40, 4), (40, 10), (60, 6), (60, 15))
SIZE, SAMPLES = (300, 480), 3
# Of blind pairs: degrees and metres of views by chance, elements in depth that a wall has, pairs on a sheet.
DEGREES, METRES, MIN_ELEMENTS, ON_SHEET = (20.0, 60.0), (4.0, 15.0), 4, 8


class Renderer:
    """Renderer of a textured mesh by the triangles and texture coordinates that are exported."""

    def __init__(self, source: TexturedMesh) -> None:
        self.source = source
        by_triangle = replace(source.mesh, chart=np.arange(len(source.mesh.triangles), dtype=np.int32))
        self.caster = RayCaster(by_triangle)

    def colours(self, origin: Float64Array, rays: Float64Array) -> UInt8Array:
        """Return the colours (n, 3) that rays (n, 3) meet."""
        source, mesh = self.source, self.source.mesh
        depth, met = self.caster.cast(origin, rays)
        out = backdrop_colour(rays).astype(np.uint8)
        hit = np.flatnonzero(met != MISS)
        corners = mesh.triangles[met[hit]]
        points = np.broadcast_to(origin, rays.shape)[hit] + depth[hit, None] * rays[hit]
        a, b, c = np.moveaxis(mesh.vertices[corners], 1, 0)
        normal = np.cross(b - a, c - a)
        size = (normal**2).sum(axis=1)
        second, third = (
            (np.cross(*pair) * normal).sum(axis=1) / size for pair in ((points - a, c - a), (b - a, points - a))
        )
        share = np.stack([1 - second - third, second, third], axis=1)
        place = np.einsum("nk,nkj->nj", share, source.coordinates[corners])
        for chart in np.unique(mesh.chart[met[hit]]).tolist():
            own = mesh.chart[met[hit]] == chart
            texel = place[own] / source.extent[chart] * source.texels[chart] - 0.5
            raster = np.ascontiguousarray(source.raster(chart))
            columns, rows = (np.ascontiguousarray(side, np.float32).reshape(-1, 1) for side in texel.T)
            for first in range(0, len(columns), 30000):  # OpenCV's limit
                some = slice(first, first + 30000)
                drawn = cv2.remap(raster, columns[some], rows[some], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
                out[hit[own][some]] = drawn.reshape(-1, 3)
        return out

    def picture(self, camera: PerspectiveCamera) -> UInt8Array:
        dense = replace(camera, size=(SIZE[0] * SAMPLES, SIZE[1] * SAMPLES))
        rays = dense.rays().reshape(-1, 3)
        return average_samples(self.colours(camera.position, rays).reshape(*dense.size, 3), SAMPLES)


def front_difference(flat: Renderer, deep: Renderer, charts: Sequence[int]) -> float:
    """Share of the texels of walls that differ from the front."""
    differing = total = 0
    source = flat.source
    for chart in charts:
        columns, rows = source.texels[chart].tolist()
        x, y = (side.ravel() for side in np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5))
        step = source.extent[chart] / source.texels[chart]
        out = source.charts.normals()[chart]
        start = source.charts.points(chart, x * step[0], y * step[1]) + 1.2 * out
        one, other = (r.colours(start, np.broadcast_to(-out, start.shape)).astype(int) for r in (flat, deep))
        differing += int((np.abs(one - other).max(axis=1) > MAX_FRONT_DIFFERENCE).sum())
        total += len(x)
    return differing / total


def glb_bytes(source: TexturedMesh, results: PublishedBlock) -> int:
    drawn = pack_charts_on_pages(source, source.select_charts(np.append(results.select_buildings(()), -1)))
    nodes, _ = build_nodes([drawn], results.names, mesh_y_up_frame(results.plan.scene.mesh))
    pages = range(len(drawn.layout.pages))
    return len(encode_glb(nodes, [encode_textures(draw_page_images(drawn, p), ENCODERS["jpeg"]) for p in pages]))


def wall_camera(source: TexturedMesh, chart: int, degrees: float, metres: float) -> PerspectiveCamera:
    """Return a camera before a wall that looks at its middle at an angle to the wall."""
    frames = source.charts
    width, height = frames.size[chart]
    low = max(1.7 + 0.3 * metres, 0.3 * height)
    target = frames.points(chart, np.array([width / 2]), np.array([max(height - low, height / 2)]))[0]
    turn = np.radians(degrees)
    away = np.sin(turn) * frames.normals()[chart] - np.cos(turn) * frames.axis_u[chart]
    place = target + metres / np.sin(turn) * away - [0.0, 0.0, 0.25 * metres]
    return PerspectiveCamera(place, target, 70.0, SIZE)


def open_views(flat: Renderer, charts: Sequence[int], count: int, rng: np.random.Generator) -> list[PerspectiveCamera]:
    """Return cameras by chance before as many walls, with nothing between."""
    found = []
    for chart in rng.permutation(np.array(charts)).tolist():
        camera = wall_camera(flat.source, chart, rng.uniform(*DEGREES), rng.uniform(*METRES))
        ray = camera.target - camera.position
        depth, met = flat.caster.cast(camera.position, ray[None])
        if met[0] != MISS and flat.source.mesh.chart[met[0]] == chart and depth[0] > 0.99:
            found.append(camera)
        if len(found) == count:
            break
    return found


def draw_pairs(outs: Sequence[Path], to: Path, seed: int) -> dict[str, Any]:
    """Write sheets of pairs, answers.csv and key.json into a folder."""
    rng = np.random.default_rng(seed)
    views: list[tuple[UInt8Array, UInt8Array]] = []
    for number, out in enumerate(outs):
        with open_published_run(out) as results:
            elements = facade_elements(results, results.select_buildings(()))
            source = results.textured_mesh
            relief = add_relief(source, elements)
            flat, deep = Renderer(source), Renderer(relief)
            rich = [chart for chart in elements if count_in_depth(relief, chart, elements[chart]) >= MIN_ELEMENTS]
            cameras = open_views(flat, rich, (PAIRS - len(views)) // (len(outs) - number), rng)
            views += [(flat.picture(camera), deep.picture(camera)) for camera in cameras]
    turned = rng.random(len(views)) < 0.5
    pairs = [pair[::-1] if turn else pair for pair, turn in zip(views, turned, strict=True)]
    to.mkdir(parents=True, exist_ok=True)
    for first in range(0, len(pairs), ON_SHEET):
        drawn = sheet(pairs[first : first + ON_SHEET], first + 1)
        Image.fromarray(drawn).save(to / f"sheet-{first // ON_SHEET + 1}.png")
    write_key(to, [("relief", "flat") if turn else ("flat", "relief") for turn in turned], seed=seed)
    return {"benchmark": "relief", "pairs": len(pairs)}


def draw_sheet(flat: Renderer, deep: Renderer, charts: Sequence[int], path: Path) -> None:
    """Draw views of walls, flat at the left and in depth at the right."""
    rows = []
    for k, (degrees, metres) in enumerate(VIEWS):
        camera = wall_camera(flat.source, charts[k // 2 % len(charts)], degrees, metres)
        rows.append(
            np.concatenate([flat.picture(camera), np.full((SIZE[0], 4, 3), 255, np.uint8), deep.picture(camera)], 1)
        )
    buffer = io.BytesIO()
    Image.fromarray(np.concatenate(rows)).save(buffer, "JPEG", quality=80, optimize=True)
    path.write_bytes(buffer.getvalue())


def measure(out: Path, sheet: Path | None) -> dict[str, Any]:
    with open_published_run(out) as results:
        elements = facade_elements(results, results.select_buildings(()))
        source = results.textured_mesh
        start = time.process_time()
        relief = add_relief(source, elements)
        seconds = time.process_time() - start
        flat, deep = Renderer(source), Renderer(relief)
        changed = [
            chart
            for chart in elements
            if len(relief.mesh.chart_triangles(chart)) > len(source.mesh.chart_triangles(chart))
        ]

        def depth(chart: int) -> int:
            return count_in_depth(relief, chart, [e for e in elements[chart] if e.label in IN_DEPTH])

        known = sum(e.label in IN_DEPTH for chart in elements for e in elements[chart])
        built = sum(map(depth, changed))
        lit, _ = mesh_with_requested_lighting(results, True, False, OFF, lit_by_default=True)
        figures = {
            "elements": known,
            "elements_in_depth": built,
            "triangles_an_element": round((len(relief.mesh.triangles) - len(source.mesh.triangles)) / max(built, 1), 1),
            "bytes_over_flat": round(glb_bytes(relief, results) / glb_bytes(source, results), 2),
            "lit_bytes_over_flat": round(glb_bytes(add_relief(lit, elements), results) / glb_bytes(lit, results), 2),
            "processor_seconds": round(seconds, 1),
            "front_differing_share": round(front_difference(flat, deep, changed), 5),
        }
        if sheet:
            most = sorted(changed, key=lambda chart: (-depth(chart), chart))[: len(VIEWS) // 2]
            draw_sheet(flat, deep, most, sheet)
    return figures


def count_in_depth(relief: TexturedMesh, chart: int, elements: Sequence[Element]) -> int:
    """Count the elements of a wall in depth: the smallest around each front behind the wall, before it for balconies."""
    if not elements:
        return 0
    own = relief.mesh.triangles[relief.mesh.chart_triangles(chart)]
    out = relief.charts.normals()[chart]
    offset = (relief.mesh.vertices[own].mean(axis=1) - relief.charts.origin[chart]) @ out
    is_front = (relief.normals[own[:, 0]] @ out > 0.99) & (np.abs(offset) > MIN_OFFSET_M)
    x, y = relief.coordinates[own[is_front]].mean(axis=1).T
    box = np.array([(e.x0, e.y0, e.x1, e.y1) for e in elements])
    is_before = np.array([e.label == "balcony" for e in elements])
    holds = (box[:, :2, None] < [x, y]).all(axis=1) & (box[:, 2:, None] > [x, y]).all(axis=1)
    holds &= is_before[:, None] == (offset[is_front] > 0)
    area = np.where(holds, np.prod(box[:, 2:] - box[:, :2], axis=1)[:, None], np.inf)
    return len(np.unique(area.argmin(axis=0)[holds.any(axis=0)]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("outs", type=Path, nargs="+", metavar="OUT")
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--pairs", type=Path, help="folder of blind pairs")
    parser.add_argument("--seed", type=int, default=7, help="of the views of pairs")
    given = parser.parse_args()
    if not given.pairs and len(given.outs) > 1:
        parser.error("several outputs are drawn with --pairs only")
    if given.pairs:
        print(json.dumps(draw_pairs(given.outs, given.pairs, given.seed)))
    else:
        print(json.dumps(measure(given.outs[0], given.sheet), indent=1))


if __name__ == "__main__":
    main()
