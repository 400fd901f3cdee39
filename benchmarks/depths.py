"""Depths of elements by parallax: `python -m benchmarks.depths` prints one JSON object; it needs no data.

Painted facades whose elements are built in depth, one depth for each class of a facade, are ray cast from three cameras
along the street. Glass shows a room behind it and a reflection that moves. Poses are off by what refinement leaves, boxes
by what a parse leaves. Of all elements: measured; wrong: share of the measured that are off by more than 10 cm; error_m:
median; table_error_m, table_wrong: the same of the table by class, of the same elements. elsewhere: facades
seen from a fourth camera at 20 to 50 degrees to the wall, against the truth: PSNR in dB and correlation of the brightness
steps, medians; of the flat wall, with the table's depths, with the measured ones and the table's where none is.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from benchmarks.painter.street_truth import SyntheticStreet, synthetic_street
from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.types import Element, Pose
from facade_core.export.bodies.balconies import extend_windows_behind_railings
from facade_core.export.bodies.settings import element_depth
from facade_core.export.bodies.textured_relief import build_wall_relief
from facade_core.export.lighting.panes import find_openings, glass_mask
from facade_core.geometry.charts import Mesh
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.rectify.element_parallax import GreyView, MeasuredDepth, measure_element_depths
from facade_core.imagery.rectify.pictured_plane import CameraFrame, camera_in_chart_frame

PAINTED_DENSITY, SAMPLES = 50.0, 2
# What refinement leaves of a pose, and a parse of a box: standard deviations.
POSE_ERROR_M, POSE_ERROR_DEG, BOX_ERROR_M = 0.04, 0.1, 0.03
# True depths by class, metres outward.
RANGES = {"window": (-0.45, -0.06), "door": (-0.6, -0.06), "shop": (-0.6, -0.06), "balcony": (0.3, 1.3)}
FLUSH_SHARE = 0.15
ROOM_DEPTH_M = 0.25
WRONG_M = 0.1


@dataclass(frozen=True, eq=False)
class DeepFacade:
    """Painted facade in depth: its mesh, places (t, 3, 2) of the corners on the wall, glass, and elements in metres."""

    caster: RayCaster
    mesh: Mesh
    place: Float64Array
    image: UInt8Array
    glass: Float64Array
    clearness: float
    elements: tuple[Element, ...]


def deepen(street: SyntheticStreet, number: int, rng: np.random.Generator) -> DeepFacade:
    """Build a facade of a street in true depth."""
    painted = street.facades[number]
    depths = {name: float(rng.uniform(*limits)) for name, limits in RANGES.items()}
    for name in ("window", "door", "shop"):
        if rng.random() < FLUSH_SHARE:
            depths[name] = 0.0
    elements = [
        replace(
            e,
            **{side: getattr(e, side) / PAINTED_DENSITY for side in ("x0", "y0", "x1", "y1")},
            depth_m=depths[e.label],
            depth_source="truth",
        )
        for e in painted.elements
    ]
    return build_facade(street, number, elements, float(rng.uniform(0.3, 0.8)))


def build_facade(street: SyntheticStreet, number: int, elements: Sequence[Element], clearness: float) -> DeepFacade:
    """Build a facade whose elements have depths."""
    scene, chart, painted = street.scene, street.charts[number], street.facades[number]
    own = scene.mesh.triangles[scene.mesh.chart_triangles(chart)]
    used, triangles = np.unique(own, return_inverse=True)
    built = extend_windows_behind_railings([e for e in elements if e.depth_m])
    position, shown = scene.mesh.vertices[used], triangles.reshape(-1, 3)
    faces = build_wall_relief(scene.charts, chart, position, shown, built, [], lambda _: False)
    if faces is not None:
        position, shown = faces.position, faces.triangles
    flat = scene.charts.coordinates(np.full(len(position), chart), position)
    place = (flat if faces is None else faces.place)[shown]
    corners = shown.astype(np.int32)
    mesh = Mesh(position, corners, np.arange(len(corners), dtype=np.int32), np.zeros(0, np.int32))
    glass = np.zeros(painted.labels.shape)
    grey = np.asarray(cv2.cvtColor(painted.image, cv2.COLOR_RGB2GRAY), np.uint8)
    for opening in find_openings(painted.labels):
        glass[opening.box] = glass_mask(opening, grey, PAINTED_DENSITY)
    return DeepFacade(RayCaster(mesh), mesh, place, painted.image, glass, clearness, tuple(elements))


def render_view(
    street: SyntheticStreet, number: int, facade: DeepFacade, true: Pose, given: Pose, density: float, seed: int
) -> UInt8Array:
    """Rectify a facade on its wall from a camera whose pose is given wrongly, grey (h, w) uint8."""
    scene, chart = street.scene, street.charts[number]
    extent = scene.charts.size[chart]
    columns, rows = (round(float(side) * density) for side in extent)
    fine = density * SAMPLES
    x, y = np.meshgrid((np.arange(columns * SAMPLES) + 0.5) / fine, (np.arange(rows * SAMPLES) + 0.5) / fine)
    points = scene.charts.points(chart, x, y).reshape(-1, 3)
    rays = (points - camera_position(given)) @ camera_from_world(given).T @ camera_from_world(true)
    origin = camera_position(true)
    distance, met = facade.caster.cast(origin, rays)
    hit = np.flatnonzero(met != MISS)
    at = origin + distance[hit, None] * rays[hit]
    a, b, c = np.moveaxis(facade.mesh.vertices[facade.mesh.triangles[met[hit]]], 1, 0)
    normal = np.cross(b - a, c - a)
    size = (normal**2).sum(axis=1)
    second, third = ((np.cross(*pair) * normal).sum(axis=1) / size for pair in ((at - a, c - a), (b - a, at - a)))
    share = np.stack([1 - second - third, second, third], axis=1)
    place = np.einsum("nk,nkj->nj", share, facade.place[met[hit]])
    out = np.zeros(len(rays), np.float32)
    out[hit] = _lit(facade, street.scene.charts, chart, place, rays[hit], number)
    image = cv2.resize(out.reshape(rows * SAMPLES, columns * SAMPLES), (columns, rows), interpolation=cv2.INTER_AREA)
    rng = np.random.default_rng(seed)
    image = image * rng.uniform(0.7, 1.1) + rng.normal(0, 2.0, image.shape)
    return np.clip(np.rint(image), 1, 255).astype(np.uint8)


def _lit(
    facade: DeepFacade, charts: Any, chart: int, place: Float64Array, rays: Float64Array, seed: int
) -> Float64Array:
    """Return the brightness (n,) of places (n, 2) along rays: glass shows a room behind it and a reflection."""
    grey = cv2.cvtColor(facade.image, cv2.COLOR_RGB2GRAY).astype(np.float32)

    def look(raster: Any, at: Float64Array) -> Any:
        texel = (at * PAINTED_DENSITY - 0.5).astype(np.float32)
        found = np.empty(len(at), np.float32)
        for first in range(0, len(at), 30000):
            part = texel[first : first + 30000]
            found[first : first + 30000] = cv2.remap(
                raster, part[:, :1].copy(), part[:, 1:].copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )[:, 0]
        return found

    axes = np.stack([charts.axis_u[chart], charts.axis_v[chart], charts.normals()[chart]])
    local = rays @ axes.T
    room = place + ROOM_DEPTH_M * local[:, :2] / np.maximum(-local[:, 2:], 1e-6)
    angle = np.column_stack([np.arctan2(local[:, 0], -local[:, 2]), np.arctan2(-local[:, 1], -local[:, 2])])
    rng = np.random.default_rng(seed)
    skyline = cv2.GaussianBlur(rng.uniform(0, 255, (256, 256)).astype(np.float32), (0, 0), 2.0)
    skyline = np.clip((skyline - skyline.mean()) * 6 + 128, 0, 255)
    texel = np.ascontiguousarray((angle / np.pi + 0.5) * 255, np.float32)
    mirrored = np.empty(len(place), np.float32)
    for first in range(0, len(place), 30000):
        part = texel[first : first + 30000]
        mirrored[first : first + 30000] = cv2.remap(skyline, part[:, :1].copy(), part[:, 1:].copy(), cv2.INTER_LINEAR)[
            :, 0
        ]
    glass = look(facade.glass.astype(np.float32), place)
    shown = facade.clearness * look(grey, room) + (1 - facade.clearness) * mirrored
    return (1 - glass) * look(grey, place) + glass * shown


def _cameras(street: SyntheticStreet, number: int, rng: np.random.Generator) -> list[tuple[Pose, Pose]]:
    """Return true and given poses of three cameras along the street before a facade."""
    charts, chart = street.scene.charts, street.charts[number]
    spacing, lane = rng.uniform(4, 10), rng.uniform(6, 11)
    middle = rng.uniform(0.2, 0.8) * charts.size[chart, 0]
    found = []
    for k in (-1, 0, 1):
        place = charts.points(chart, np.array([middle + k * spacing]), np.array([charts.size[chart, 1] - 2.5]))[0]
        x, y, z = (place + lane * charts.normals()[chart]).tolist()
        off = rng.normal(0, POSE_ERROR_M, 3)
        turned = rng.normal(0, POSE_ERROR_DEG, 3)
        true = Pose(x, y, z, float(rng.uniform(0, 360)))
        given = Pose(x + off[0], y + off[1], z + off[2], true.heading + turned[0], turned[1], turned[2])
        found.append((true, given))
    return found


def _likeness(
    street: SyntheticStreet, number: int, truth: DeepFacade, measured: Sequence[Element], seed: int
) -> dict[str, tuple[float, float]]:
    """Return the likeness to the truth of models of a facade from a camera that measured nothing."""
    charts, chart = street.scene.charts, street.charts[number]
    rng = np.random.default_rng([seed, number, 4])
    turn, metres = np.radians(rng.uniform(20, 50)), rng.uniform(6, 12)
    width, height = charts.size[chart]
    foot = charts.points(chart, np.array([rng.uniform(0.3, 0.7) * width]), np.array([height - 2.5]))[0]
    place = foot + metres * (np.sin(turn) * charts.normals()[chart] + np.cos(turn) * charts.axis_u[chart])
    x, y, z = place.tolist()
    pose = Pose(x, y, z, 0.0)

    def look(facade: DeepFacade) -> Any:
        return render_view(street, number, facade, pose, pose, 20.0, seed).astype(float)

    by_table = [replace(e, depth_m=None) for e in measured]
    models = {
        "flat": [replace(e, depth_m=0.0) for e in measured],
        "table": [replace(e, depth_m=element_depth(e).outward_m) for e in by_table],
        "measured": [replace(e, depth_m=element_depth(e).outward_m) for e in measured],
    }
    shown = look(truth)
    found = {}
    for name, elements in models.items():
        own = look(build_facade(street, number, elements, truth.clearness))
        steps = [np.hypot(*np.gradient(cv2.GaussianBlur(one, (0, 0), 1.0))).ravel() for one in (own, shown)]
        psnr = 10 * np.log10(255**2 / max(float(((own - shown) ** 2).mean()), 1e-9))
        found[name] = (float(psnr), float(np.corrcoef(*steps)[0, 1]))
    return found


def _found_box(element: Element, camera: CameraFrame, rng: np.random.Generator) -> Element:
    """Return the box that a parse finds in a camera's view: what stands out is displaced there."""
    out = max(element.depth_m or 0.0, 0.0)
    scale = camera.before / (camera.before - out)
    off = rng.normal(0, BOX_ERROR_M, 4)
    x0, x1 = (camera.right + (x - camera.right) * scale for x in (element.x0, element.x1))
    y0, y1 = (camera.down + (y - camera.down) * scale for y in (element.y0, element.y1))
    return Element(element.label, x0 + off[0], y0 + off[1], x1 + off[2], y1 + off[3])


def measure(streets: Sequence[int], density: float, verbose: bool) -> dict[str, Any]:
    told: dict[str, list[tuple[float, float | None, float]]] = {}
    likeness: list[dict[str, tuple[float, float]]] = []
    seconds = 0.0
    for seed in streets:
        street = synthetic_street(4, seed=seed, occluders=0, texels_per_metre=PAINTED_DENSITY)
        for number in range(len(street.charts)):
            rng = np.random.default_rng([seed, number])
            facade = deepen(street, number, rng)
            poses = _cameras(street, number, rng)
            frames = [camera_in_chart_frame(street.scene, street.charts[number], given) for _, given in poses]
            views = [
                GreyView(render_view(street, number, facade, true, given, density, 3 * seed + k), frame)
                for k, ((true, given), frame) in enumerate(zip(poses, frames, strict=True))
            ]
            middles = [(e.x0 + e.x1) / 2 for e in facade.elements]
            source = np.array([int(np.argmin([abs(f.right - x) for f in frames])) for x in middles])
            boxes = [_found_box(e, frames[k], rng) for e, k in zip(facade.elements, source.tolist(), strict=True)]
            start = time.process_time()
            measured = measure_element_depths(boxes, views, source, density)
            seconds += time.process_time() - start
            of = {k: one for one in measured if one.is_reliable for k in one.members}
            for one in measured if verbose else ():
                print(f"{seed}-{number}", *_describe(one, facade.elements))
            for k, element in enumerate(facade.elements):
                table = element_depth(replace(element, depth_m=None)).outward_m
                found = of[k].outward_m if k in of else None
                told.setdefault(element.label, []).append((element.depth_m or 0.0, found, table))
            known = [replace(e, depth_m=of[k].outward_m if k in of else None) for k, e in enumerate(facade.elements)]
            likeness.append(_likeness(street, number, facade, known, seed))
    return {
        "benchmark": "depths",
        **{name: _summarise(values) for name, values in sorted(told.items())},
        "all": _summarise([one for values in told.values() for one in values]),
        "elsewhere": {
            name: {
                key: round(statistics.median(one[name][k] for one in likeness), 2 if k else 1)
                for k, key in enumerate(("psnr_db", "steps"))
            }
            for name in likeness[0]
        },
        "seconds_a_facade": round(seconds / (4 * len(streets)), 2),
    }


def _describe(one: MeasuredDepth, elements: Sequence[Element]) -> tuple[str, ...]:
    first = elements[one.members[0]]
    return (
        f"{first.label} x{len(one.members)}, true {first.depth_m:+.2f}, found {one.outward_m:+.3f} +- {one.error_m:.3f},",
        f"correlation {one.correlation:.2f}, margin {one.margin:.2f}, {'kept' if one.is_reliable else 'rejected'}",
    )


def _summarise(values: Sequence[tuple[float, float | None, float]]) -> dict[str, Any]:
    errors = [(abs(found - true), abs(table - true)) for true, found, table in values if found is not None]
    told: dict[str, Any] = {"elements": len(values), "measured": round(len(errors) / len(values), 3)}
    if errors:
        told |= {
            "wrong": round(statistics.mean(own > WRONG_M for own, _ in errors), 3),
            "error_m": round(statistics.median(own for own, _ in errors), 3),
            "table_error_m": round(statistics.median(table for _, table in errors), 3),
            "table_wrong": round(statistics.mean(table > WRONG_M for _, table in errors), 3),
        }
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streets", type=int, default=8)
    parser.add_argument("--seed", type=int, default=20, help="of the first street; rules were chosen on 1 to 4")
    parser.add_argument("--density", type=float, default=40.0, help="texels per metre of the rectified pictures")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    print(json.dumps(measure(range(given.seed, given.seed + given.streets), given.density, given.verbose), indent=1))


if __name__ == "__main__":
    main()
