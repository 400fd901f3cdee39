"""The test block, Ingolstadt with windows and doors, walked along with any translator and any way of blending."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from benchmarks.papers.translator.projection import project_points_to_panorama
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.provenance import Provenance
from facade_core.core.types import Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, place_viewpoints
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import RenderedPanorama, render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer

WIDTH = 512
TEXELS_PER_METRE = 10.0
STREETS, VIEWPOINTS = 6, 8
# two frames: the weighting of the authors' released code, softmax of minus the metres over a frame and the one before it.
Blending = Literal["no blend", "average", "two frames", "weighted"]
BLENDINGS: tuple[Blending, ...] = ("no blend", "average", "two frames", "weighted")
# What a translator is given: the panorama as the engine renders it, and the same without any texture.
Translate = Callable[[RenderedPanorama, RenderedPanorama], np.ndarray]
# Metres by which what a viewpoint sees may be off what the one before saw.
_SAME_M = 0.15


@dataclass(frozen=True)
class Walk:
    """A street after all its viewpoints: its window, and the mean absolute difference (0 to 255) between what consecutive
    outputs show of the same place."""

    window: TexelBuffer
    difference: float


def ingolstadt(data: Path) -> tuple[Scene, list[list[Viewpoint]], list[Street]]:
    """The scene, and the viewpoints of its longest streets that stand between buildings."""
    from catalogs.block.reader import read_block

    os.environ["STREETLOOM_DATA"] = str(data)
    read = read_block(Path(__file__).parent / "ingolstadt_lod3.yaml")
    streets = sorted(read.streets, key=lambda s: -s.line.length)[:STREETS]
    terrain = build_terrain(read.buildings, None)
    charts, mesh, _ = build_block_surfaces(
        read.buildings,
        streets,
        terrain=terrain,
        ground_margin=40.0,
        largest=AtlasSpec(1, TEXELS_PER_METRE).max_chart_side,
    )
    placement = pack_charts(charts.size, TEXELS_PER_METRE, charts.building, page=2048, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, TEXELS_PER_METRE))
    own = []
    for number, street in enumerate(streets):
        positions, forward = place_viewpoints(street.line, ground=terrain.interpolate)
        first = max(0, (len(positions) - VIEWPOINTS) // 2)
        chosen = list(zip(positions, forward, strict=True))[first : first + VIEWPOINTS]
        own.append([Viewpoint(100 * number + i, number, p, f) for i, (p, f) in enumerate(chosen)])
    return scene, own, streets


def walk(scene: Scene, viewpoints: Sequence[Viewpoint], translate: Translate, blending: Blending = "weighted") -> Walk:
    """Texture a street from nothing."""
    charts = np.unique(np.concatenate([scene.visible_charts(viewpoint, WIDTH) for viewpoint in viewpoints]))
    window, empty = _window(scene, charts), _window(scene, charts)
    total, count = np.zeros((len(window.colour), 3), np.int64), np.zeros(len(window.colour), np.int64)
    held: tuple[np.ndarray, np.ndarray] | None = None
    differences = []
    before: tuple[RenderedPanorama, np.ndarray] | None = None
    for viewpoint in viewpoints:
        panorama = render_panorama(scene, window, viewpoint, (WIDTH // 2, WIDTH))
        rgb = translate(panorama, render_panorama(scene, empty, viewpoint, (WIDTH // 2, WIDTH)))
        if blending == "weighted":
            propagate_panorama(scene, window, viewpoint, rgb, charts_seen=panorama.chart)
        else:
            latest = _window(scene, charts)
            propagate_panorama(scene, latest, viewpoint, rgb, charts_seen=panorama.chart)
            taken = np.flatnonzero(latest.provenance)
            total[taken] += latest.colour[taken]
            count[taken] += 1
            metres = np.where(latest.provenance > 0, latest.state.top_distance[:, 0] / 1000, np.inf)
            if blending == "average":
                window.colour[taken] = np.floor(total[taken] / count[taken, None] + 0.5).astype(np.uint8)
            elif blending == "two frames" and held is not None:
                window.colour[taken] = _mix_frames(latest.colour[taken], metres[taken], *(part[taken] for part in held))
            else:
                window.colour[taken] = latest.colour[taken]
            window.provenance[taken] = Provenance.TRANSLATED
            window.state.views[taken] += np.minimum(latest.state.views[taken], 1)
            held = latest.colour, metres
        if before is not None:
            differences.append(_difference(*before, panorama, rgb))
        before = (panorama, rgb)
    return Walk(window, float(np.mean(differences)))


def _mix_frames(latest: np.ndarray, metres: np.ndarray, earlier: np.ndarray, earlier_metres: np.ndarray) -> np.ndarray:
    """Mix the colours (n, 3) of two frames by softmax of minus their distances, inf where a frame does not see a texel."""
    share = (1 / (1 + np.exp(np.minimum(metres - earlier_metres, 50.0))))[:, None]
    return np.floor(share * latest + (1 - share) * earlier + 0.5).astype(np.uint8)


def between(viewpoints: Sequence[Viewpoint]) -> list[Viewpoint]:
    """Viewpoints halfway between consecutive ones: where nobody stood who textured the street."""
    return [
        Viewpoint(a.id, a.street, (a.position + b.position) / 2, a.forward)
        for a, b in zip(viewpoints[:-1], viewpoints[1:], strict=True)
    ]


def _window(scene: Scene, charts: np.ndarray) -> TexelBuffer:
    rasters, write = TexelBuffer.plan_layout(scene.placement, charts, charts)
    seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    return TexelBuffer.allocate(scene.placement, rasters, write, seed, evidence)


def _difference(earlier: RenderedPanorama, old: np.ndarray, later: RenderedPanorama, new: np.ndarray) -> float:
    """Mean absolute difference of two panoramas where both see the same place."""
    seen = later.chart >= 0
    points = later.points[seen]
    place, distance = project_points_to_panorama(
        points, earlier.viewpoint.position, earlier.viewpoint.forward, old.shape[1]
    )
    column = np.minimum(place[:, 0].astype(int) % old.shape[1], old.shape[1] - 1)
    row = np.clip(place[:, 1].astype(int), 0, old.shape[0] - 1)
    same = (earlier.chart[row, column] == later.chart[seen]) & (np.abs(earlier.depth[row, column] - distance) < _SAME_M)
    return float(np.abs(new[seen][same].astype(int) - old[row[same], column[same]]).mean())
