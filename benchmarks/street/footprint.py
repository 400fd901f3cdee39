"""Ground from panoramas: which views are proper by what their pixels cover of it.

python -m benchmarks.street.footprint

A street of two rows of houses, its ground in known materials, is rendered to panoramas 5 m apart (the means of 3 x 3 rays a
pixel) and propagated. A view whose pixels cover more than k times what the finest view of a texel covers so far is none of
its proper views; one that covers less than a k-th of the finest so far begins the texel anew. k = inf is Eq. 1 as it is pinned
(ADR 0010). psnr: of texels within the street; detail: the energy of their gradients over the truth's; finest: of the view alone
whose pixels cover least. walked: each viewpoint keeps what is textured already and
paints the rest, as a translator that answers with pixels does; frozen: also what was textured from far.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.painter.street_truth import STREET_HALF_WIDTH_M, SyntheticStreet, synthetic_street
from benchmarks.street.readings import Reading, View, _resolution, blended, view_of
from facade_core.core.types import Street
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.translator.translators import MaterialFieldTranslator

TEXELS_PER_METRE, WIDTH, SUPERSAMPLED, SPACING_M, HEIGHT_M = 20.0, 1024, 3, 5.0, 2.5
LIMITS = (np.inf, 4.0, 2.0, 1.5)
# Standard deviations of a pose's error: metres on each axis, degrees of heading.
POSE_ERRORS = {"exact poses": (0.0, 0.0), "5 cm, 0.2 deg": (0.05, 0.2)}
SEED = 3


def measure() -> dict[str, Any]:
    street = synthetic_street(8, seed=1, occluders=0, texels_per_metre=TEXELS_PER_METRE)
    materials = MaterialField(street.scene, [_line(street)], seed=SEED)
    ground = np.flatnonzero(street.scene.charts.kind == ChartKind.GROUND)
    found: dict[str, Any] = {}
    for name, errors in POSE_ERRORS.items():
        views, footprints, total = _views(street, materials, ground, errors)
        found[name] = {}
        for limit in LIMITS:
            colour, count = blended(limited(views, footprints, total, limit), total, Reading())
            found[name][f"k = {limit:g}"] = _scores(street, materials, ground, colour, count > 0)
        colour, count = _finest(views, footprints, total)
        found[name]["finest"] = _scores(street, materials, ground, colour, count)
    found["walked"] = {
        name: _walked(street, materials, ground, limit, frozen=name == "frozen")
        for name, limit in (("frozen", np.inf), ("k = inf", np.inf), ("k = 4", 4.0), ("k = 2", 2.0))
    }
    return found


def limited(views: list[View], footprints: list[np.ndarray], total: int, limit: float) -> list[View]:
    """The views of `total` texels, footprints what their pixels cover, with those no longer proper that are too coarse."""
    finest = np.full(total, np.inf)
    since = np.zeros(len(finest), np.int64)
    proper = []
    for number, (view, covered) in enumerate(zip(views, footprints, strict=True)):
        best = finest[view.texel]
        counts = view.proper & (covered <= limit * best)
        anew = counts & (covered * limit < best)
        since[view.texel[anew]] = number
        finest[view.texel[counts]] = np.minimum(best, covered)[counts]
        proper.append(counts)
    return [
        view._replace(proper=counts & (since[view.texel] <= number))
        for number, (view, counts) in enumerate(zip(views, proper, strict=True))
    ]


def _line(street: SyntheticStreet) -> Street:
    import shapely

    return Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))


def _views(
    street: SyntheticStreet, materials: MaterialField, ground: np.ndarray, errors: tuple[float, float]
) -> tuple[list[View], list[np.ndarray], int]:
    """What each panorama shows of the ground, and what its pixels cover there along the ray, metres."""
    scene, rng = street.scene, np.random.default_rng(SEED)
    views, footprints = [], []
    for viewpoint in _cameras(street):
        off, turn = rng.normal(0, errors[0], 3), np.radians(rng.normal(0, errors[1]))
        forward = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ viewpoint.forward
        taken = Viewpoint(viewpoint.id, 0, viewpoint.position + off, forward)
        rgb = _picture(scene, materials, taken)
        empty = _window(scene, ground)
        view = view_of(scene, empty, viewpoint, rgb, seen=scene.cast_panorama(viewpoint, WIDTH)[2])
        views.append(view)
        footprints.append(_covered(scene, empty, viewpoint, view.texel))
    return views, footprints, len(empty.colour)


def _cameras(street: SyntheticStreet) -> list[Viewpoint]:
    along = np.arange(SPACING_M / 2, street.length, SPACING_M)
    places = [np.array([*street.world_point(float(at), 0.0), HEIGHT_M]) for at in along]
    return [Viewpoint(number, 0, place, street.axis) for number, place in enumerate(places)]


def _picture(scene: Scene, materials: MaterialField, taken: Viewpoint) -> np.ndarray:
    """A panorama (h, w, 3) of materials, each pixel the mean of rays."""
    import cv2

    width = WIDTH * SUPERSAMPLED
    rays = panorama_rays(taken.forward, width)
    depth, chart = scene.caster.cast(taken.position, rays)
    hit = (chart != MISS) & (depth < 60)
    points = taken.position + rays[hit] * depth[hit][:, None]
    normal = scene.charts.normals()[chart[hit]]
    flat = np.abs(np.einsum("ij,ij->i", normal, rays[hit]))
    fine = np.zeros((*chart.shape, 3), np.uint8)
    fine[hit] = materials.colour(chart[hit], points, depth[hit] * 2 * np.pi / width / np.sqrt(np.maximum(flat, 0.02)))
    return cv2.resize(fine, (WIDTH, WIDTH // 2), interpolation=cv2.INTER_AREA)


def _window(scene: Scene, ground: np.ndarray) -> TexelBuffer:
    rasters, write = TexelBuffer.plan_layout(scene.placement, ground, ground)
    return TexelBuffer.allocate(
        scene.placement, rasters, write, np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    )


def _finest(views: list[View], footprints: list[np.ndarray], total: int) -> tuple[np.ndarray, np.ndarray]:
    finest, colour = np.full(total, np.inf), np.zeros((total, 3), np.uint8)
    for view, covered in zip(views, footprints, strict=True):
        better = covered < finest[view.texel]
        finest[view.texel[better]], colour[view.texel[better]] = covered[better], view.rgb[better]
    return colour, np.isfinite(finest)


def _walked(
    street: SyntheticStreet, materials: MaterialField, ground: np.ndarray, limit: float, *, frozen: bool
) -> dict[str, float]:
    """Viewpoint by viewpoint with a translator that answers with pixels. Texels of which a viewpoint covers less than a
    `limit`-th of what the finest view did are bare again; frozen: whatever was textured from far counts as textured."""
    scene = street.scene
    window, swatches = _window(scene, ground), MaterialFieldTranslator(scene, [_line(street)], seed=SEED)
    shown = window
    if frozen:
        shown = replace(window, state=window.state._replace(views=np.ones_like(window.state.views)))
    finest = np.full(len(window.colour), np.inf)
    everything = np.arange(len(finest))
    for viewpoint in _cameras(street):
        covered = _covered(scene, window, viewpoint, everything)
        anew = covered * limit < finest
        for array in (window.state.views, window.state.distance, window.state.colour, window.provenance):
            array[anew & np.isfinite(limit)] = 0
        panorama = render_panorama(scene, shown, viewpoint, (WIDTH // 2, WIDTH))
        before = window.state.views.copy()
        propagate_panorama(scene, window, viewpoint, swatches.translate(panorama), charts_seen=panorama.chart)
        added = window.state.views > before
        finest[added] = np.minimum(finest, covered)[added]
    return _scores(street, materials, ground, window.colour, window.provenance > 0)


def _covered(scene: Scene, window: TexelBuffer, viewpoint: Viewpoint, texel: np.ndarray) -> np.ndarray:
    """What a panorama's pixels cover of texels (k,) along the ray, metres."""
    return 1 / (TEXELS_PER_METRE * np.maximum(_resolution(scene, window, viewpoint, texel, WIDTH), 1e-9))


def _scores(
    street: SyntheticStreet, materials: MaterialField, ground: np.ndarray, colour: np.ndarray, known: np.ndarray
) -> dict[str, float]:
    scene = street.scene
    rasters, _ = TexelBuffer.plan_layout(scene.placement, ground, ground)
    across = np.array([-street.axis[1], street.axis[0]])
    error, energy, true = [], 0.0, 0.0
    for chart in ground.tolist():
        held = rasters.texel_slice(scene.placement, chart)
        shape = (int(scene.placement.height[chart]), int(scene.placement.width[chart]))
        x, y = np.meshgrid(
            (np.arange(shape[1]) + 0.5) / TEXELS_PER_METRE, (np.arange(shape[0]) + 0.5) / TEXELS_PER_METRE
        )
        points = scene.charts.points(chart, x, y)[..., :2] - street.world_point(0, 0)
        inside = (
            (np.abs(points @ across) < STREET_HALF_WIDTH_M)
            & (points @ street.axis > 0)
            & (points @ street.axis < street.length)
        )
        inside &= known[held].reshape(shape)
        if not inside.any():
            continue
        image, truth = colour[held].reshape(*shape, 3).astype(float), materials.chart_raster(chart).astype(float)
        error.append(((image - truth) ** 2)[inside])
        for axis in (0, 1):
            pair = np.logical_and(*(np.take(inside, range(k, shape[axis] - 1 + k), axis) for k in (0, 1)))
            energy += float((np.diff(image, axis=axis) ** 2)[pair].sum())
            true += float((np.diff(truth, axis=axis) ** 2)[pair].sum())
    wrong = float(np.mean(np.concatenate(error)))
    return {"psnr": round(10 * np.log10(255**2 / wrong), 2), "detail": round(energy / true, 3)}


def main() -> None:
    load = round(os.getloadavg()[0], 1)
    print(json.dumps({"load_before": load, **measure()}, indent=2))


if __name__ == "__main__":
    main()
