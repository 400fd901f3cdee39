"""Which panoramas show a chart, and how well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.rectify.camera import in_view, position, shares
from facade_core.street.scene import Scene
from facade_core.types import Pose

# Flatter than this, a wall's pixels are stretched and its balconies hide its windows.
GRAZING_DEG = 12.0
# What lies this close before a surface does not hide it: mouldings, and the noise of the model.
SKIN_M = 0.05
# A sighting shows at least this share of the chart.
LEAST_SEEN = 0.02
# Points of a chart that are looked at, per axis.
SAMPLES = (12, 8)


@dataclass(frozen=True, slots=True)
class Sighting:
    """A panorama that shows a chart: pose, its index; seen, the share of the chart; pixels_per_metre and obliquity (degrees
    between line of sight and surface), means over what is seen; score, higher is better."""

    pose: int
    seen: float
    pixels_per_metre: float
    obliquity: float
    score: float


def sightings(
    scene: Scene,
    chart: int,
    poses: Sequence[Pose],
    image_sizes: Sequence[tuple[int, int]],
    *,
    reach: float = 80.0,
) -> list[Sighting]:
    """Panoramas that show a chart within `reach` metres, best first; image_sizes are (height, width) in pixels.

    A point counts as seen where nothing is before it, its surface is not seen at a grazing angle and the picture's view holds
    it. The score is the share seen, less for pictures coarser than the atlas and for oblique ones, in which what stands out
    of the wall is displaced. Raises GeometryError for a pose without height.
    """
    points = _grid(scene, chart)
    if len(points) == 0 or len(poses) == 0:
        return []
    normal = scene.charts.normal()[chart]
    places = np.array([position(pose) for pose in poses])
    corner = points - points.mean(axis=0)
    radius = np.sqrt((corner**2).sum(axis=1).max())
    offset = places - points.mean(axis=0)
    near = (offset @ normal > 0) & (np.linalg.norm(offset, axis=1) <= reach + radius)
    found = []
    for index in np.flatnonzero(near).tolist():
        pose, (_, width) = poses[index], image_sizes[index]
        ray = points - places[index]
        distance = np.linalg.norm(ray, axis=1)
        sine = -(ray @ normal) / np.maximum(distance, 1e-9)
        usable = (distance <= reach) & (sine >= np.sin(np.radians(GRAZING_DEG))) & in_view(shares(ray, pose), pose)
        usable[usable] = visible(scene, chart, places[index], ray[usable])
        seen = float(usable.mean())
        if seen < LEAST_SEEN:
            continue
        pixels_per_radian = width / pose.view[2] / (2 * np.pi)
        resolution = float((pixels_per_radian / distance[usable] * np.sqrt(sine[usable])).mean())
        facing = float(sine[usable].mean())
        score = seen * min(1.0, resolution / scene.spec.texels_per_metre) * facing
        found.append(Sighting(index, seen, resolution, float(np.degrees(np.arcsin(facing))), score))
    return sorted(found, key=lambda sighting: (-sighting.score, sighting.pose))


def visible(scene: Scene, chart: int, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Whether the points origin + rays (..., 3) on a chart are in sight: (...,) bool."""
    reached, hit = scene.caster.cast(origin, rays)
    surface = scene.charts.surface
    own = (hit >= 0) & (surface[hit] == surface[chart])
    return own | ((1.0 - reached) * np.linalg.norm(rays, axis=-1) < SKIN_M)


def _grid(scene: Scene, chart: int) -> np.ndarray:
    """World points (k, 3) evenly spread over a chart's own triangles."""
    charts, mesh = scene.charts, scene.mesh
    at = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in SAMPLES)), axis=-1).reshape(-1, 2)
    at = at * charts.size[chart]
    corners = mesh.vertices[mesh.triangles[mesh.chart == chart]] - charts.origin[chart]
    flat = corners @ np.column_stack([charts.axis_u[chart], charts.axis_v[chart]])
    edge = np.roll(flat, -1, axis=1) - flat
    to = at[:, None, None] - flat
    side = edge[..., 0] * to[..., 1] - edge[..., 1] * to[..., 0]
    inside = ((side >= 0).all(axis=2) | (side <= 0).all(axis=2)).any(axis=1)
    return charts.origin[chart] + at[inside] @ np.stack([charts.axis_u[chart], charts.axis_v[chart]])
