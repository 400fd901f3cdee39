"""One viewpoint after another on the shells of Ingolstadt, without a store and without a network."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, place_viewpoints
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.translator.translators import MaterialFieldTranslator

WIDTH = 512
# So dense that the charts that a viewpoint sees hold about as many texels as a page of 2048 x 2048.
TEXELS_PER_METRE = 23.0
REACH_M = 40.0
VIEWPOINTS = 16


def measure(folder: Path) -> dict[str, Any]:
    """Medians over viewpoints of seconds per stage, wall and processor, and of the texels in view."""
    scene, street, own = ingolstadt(folder, TEXELS_PER_METRE)
    one, two = (steps(scene, [street], own[:VIEWPOINTS], threads=n) for n in (1, 2))
    return two | {"seconds_one_thread": one["seconds"]}


def ingolstadt(folder: Path, texels_per_metre: float) -> tuple[Scene, Street, list[Viewpoint]]:
    """The scene of all shells, its longest street and the viewpoints of that."""
    from catalogs.block.reader import read_block

    os.environ["STREETLOOM_DATA"] = str(folder.parent.parent)
    block = read_block(Path(__file__).parents[2] / "catalogs" / "blocks" / "ingolstadt.yaml")
    street = max(block.streets, key=lambda s: s.line.length)
    terrain = build_terrain(block.buildings, None)
    charts, mesh, _ = build_block_surfaces(
        block.buildings,
        [street],
        terrain=terrain,
        ground_margin=REACH_M,
        largest=AtlasSpec(1, texels_per_metre).max_chart_side,
    )
    placement = pack_charts(charts.size, texels_per_metre, charts.building, page=2048, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, texels_per_metre))
    return scene, street, cameras(street, terrain.interpolate)


def cameras(
    street: Street, ground: Callable[[np.ndarray], np.ndarray], *, first: int = 0, number: int = 0
) -> list[Viewpoint]:
    """Viewpoints of a street, with ids from `first`; ground: heights (n,) of points (n, 2)."""
    positions, forward = place_viewpoints(street.line, ground=ground)
    return [Viewpoint(first + i, number, p, f) for i, (p, f) in enumerate(zip(positions, forward, strict=True))]


def window_of(scene: Scene, own: list[Viewpoint]) -> TexelBuffer:
    """A window that writes every chart that the viewpoints see."""
    charts = np.unique(np.concatenate([scene.visible_charts(v, WIDTH) for v in own]))
    rasters, write = TexelBuffer.plan_layout(scene.placement, charts, charts)
    seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    return TexelBuffer.allocate(scene.placement, rasters, write, seed, evidence)


def steps(scene: Scene, streets: list[Street], own: list[Viewpoint], *, threads: int = 1) -> dict[str, Any]:
    """Walk along the viewpoints twice, and time the second walk: the first one compiles and fills caches."""
    translator = MaterialFieldTranslator(scene, streets, seed=7)
    texels = scene.placement.width.astype(np.int64) * scene.placement.height
    for _ in range(2):
        window = window_of(scene, own)
        wall: dict[str, list[float]] = {"render": [], "translate": [], "propagate": [], "render + propagate": []}
        processor: list[float] = []
        visible, written = [], []
        for viewpoint in own:
            before = int((window.provenance > 0).sum())
            clocks, begun = [time.perf_counter()], time.process_time()
            panorama = render_panorama(scene, window, viewpoint, (WIDTH // 2, WIDTH))
            clocks.append(time.perf_counter())
            rendered = time.process_time()
            rgb = translator.translate(panorama)
            clocks.append(time.perf_counter())
            translated = time.process_time()
            propagate_panorama(scene, window, viewpoint, rgb, charts_seen=panorama.chart, threads=threads)
            clocks.append(time.perf_counter())
            processor.append(time.process_time() - translated + rendered - begun)
            for stage, seconds in zip(("render", "translate", "propagate"), np.diff(clocks), strict=True):
                wall[stage].append(float(seconds))
            wall["render + propagate"].append(wall["render"][-1] + wall["propagate"][-1])
            visible.append(int(texels[np.unique(panorama.chart[panorama.chart >= 0])].sum()))
            written.append(int((window.provenance > 0).sum()) - before)
    return {
        "panorama": f"{WIDTH} x {WIDTH // 2}",
        "viewpoints": len(own),
        "texels_of_charts_in_view_million": round(statistics.median(visible) / 1e6, 2),
        "texels_new_per_viewpoint_million": round(statistics.median(written) / 1e6, 3),
        "window_million_texels": round(window.layout.total / 1e6, 1),
        "seconds": {stage: round(statistics.median(values), 4) for stage, values in wall.items()},
        "processor_seconds_render_propagate": round(statistics.median(processor), 4),
    }
