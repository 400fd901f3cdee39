"""Windows where the geometry has windows: facades of the test block parsed, against the windows of its model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.papers.translator.projection import project_points_to_panorama
from benchmarks.street.truth import interval
from facade_core.core.labels import FacadeClass
from facade_core.geometry.charts import CORNER_SHARES, ChartKind
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.parsing.segmenter import parse
from facade_core.street.propagation.render import RenderedPanorama

PIXELS_PER_METRE = 16.0
LEAST_M2, LEAST_WINDOWS = 40.0, 0.04
# Metres that what a pixel shows may lie behind or before the facade's plane: windows are set back.
DEPTH_M = 0.6
FACADES = 24


def measure(scene: Scene, own: Sequence[Viewpoint], panoramas: dict[str, list[RenderedPanorama]]) -> dict[str, Any]:
    """IoU of parsed windows with true ones over the facades in view, by kind of panorama; one panorama a viewpoint."""
    scores: dict[str, list[float]] = {name: [] for name in panoramas}
    for plane in _planes(scene):
        cuts = {name: _cut(scene, own, views, plane) for name, views in panoramas.items()}
        for name, cut in cuts.items():
            if cut is not None:  # the geometry decides, so it is none or all
                image, truth, seen = cut
                windows = parse(image).labels == FacadeClass.WINDOW
                either = ((windows | truth) & seen).sum()
                scores[name].append(float((windows & truth & seen).sum() / max(either, 1)))
        if len(next(iter(scores.values()))) == FACADES:
            break
    found = {name: interval(values) for name, values in scores.items()}
    return {"facades": len(next(iter(scores.values()))), **found}


def _planes(scene: Scene) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Facades, largest first: origin, unit right, unit down, and (width, height) of the rectangle around the walls of one
    building that lie in one plane."""
    charts, normal = scene.charts, scene.charts.normals()
    wall = np.flatnonzero((charts.kind == ChartKind.WALL) & (np.abs(normal[:, 2]) < 0.05))
    offset = np.einsum("ij,ij->i", normal[wall], charts.origin[wall])
    heading = np.degrees(np.arctan2(normal[wall, 1], normal[wall, 0]))
    key = np.column_stack([charts.building[wall], np.round(heading / 4), np.round(offset / 0.5)]).astype(int)
    planes = []
    for group in np.unique(key, axis=0):
        own = wall[(key == group).all(1)]
        largest = own[np.argmax(charts.size[own].prod(1))]
        right, down = charts.axis_u[largest], charts.axis_v[largest]
        corners = charts.points_at_shares(own, CORNER_SHARES).reshape(-1, 3)
        x, y = corners @ right, corners @ down
        size = np.array([np.ptp(x), np.ptp(y)])
        if size.prod() < LEAST_M2 or size.min() < 3:
            continue
        at = charts.origin[largest]
        origin = at + (x.min() - at @ right) * right + (y.min() - at @ down) * down
        planes.append((origin, right, down, size))
    return sorted(planes, key=lambda plane: -float(plane[3].prod()))


def _cut(
    scene: Scene, own: Sequence[Viewpoint], views: Sequence[RenderedPanorama], plane: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """A facade as its nearest viewpoint shows it: image (h, w, 3) uint8, true windows (h, w), seen (h, w); None where it is not
    well in view or has no windows."""
    origin, right, down, size = plane
    outward = np.cross(down, right)
    middle = origin + size[0] / 2 * right + size[1] / 2 * down
    offsets = np.array([viewpoint.position for viewpoint in own]) - middle
    before = offsets @ outward
    distance = np.where((before > 4) & (before < 25), np.linalg.norm(offsets, axis=1), np.inf)
    number = int(np.argmin(distance))
    if not np.isfinite(distance[number]) or distance[number] > 25:
        return None
    view, camera = views[number], own[number]
    columns, rows = (np.round(size * PIXELS_PER_METRE)).astype(int)
    x, y = np.meshgrid((np.arange(columns) + 0.5) / PIXELS_PER_METRE, (np.arange(rows) + 0.5) / PIXELS_PER_METRE)
    points = origin + x[..., None] * right + y[..., None] * down
    place, reach = project_points_to_panorama(points, camera.position, camera.forward, view.rgb.shape[1])
    u = np.clip(place[..., 0].astype(int), 0, view.rgb.shape[1] - 1)
    v = np.clip(place[..., 1].astype(int), 0, view.rgb.shape[0] - 1)
    # how far behind the plane the surface seen there lies
    cosine = np.abs((points - camera.position) @ outward) / reach
    seen = np.abs(view.depth[v, u] - reach) * cosine < DEPTH_M
    truth = (scene.charts.kind[np.maximum(view.chart[v, u], 0)] == ChartKind.WINDOW) & (view.chart[v, u] >= 0) & seen
    if seen.mean() < 0.6 or truth.sum() < LEAST_WINDOWS * seen.sum():
        return None
    return view.rgb[v, u], truth, seen
