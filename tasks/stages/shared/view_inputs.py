"""Views of the block as inputs of units: each is told by what a unit may see, and by nothing else of the block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import blake2b
from pathlib import Path

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Pose
from facade_core.geometry.charts import CORNER_SHARES
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.stages.shared.scene_view import SceneView
from tasks.stages.shared.surface_panorama import SurfacePanorama

# What of a block a panorama may be matched with, metres from where it was taken.
POSE_SURROUNDINGS_M = 150.0
# Geometry lies this far off the planes of its charts at most.
OFF_PLANE_M = 1.0
# What does not rise this far above the foot of a wall does not hide it.
MIN_OCCLUDER_RISE_M = 0.01


def view_between(run: Run, plan: Plan, charts_of: Mapping[SurfacePanorama, Sequence[int]]) -> SceneView:
    """Return a view of what may stand between panoramas and the charts that are taken from each."""
    charts = sorted({chart for charts in charts_of.values() for chart in charts})
    return SceneView(
        run,
        tuple(charts),
        tuple(tuple(object_digests_between(plan, charts, one.pose)) for one, charts in charts_of.items()),
    )


def object_digests_between(plan: Plan, charts: Sequence[int], pose: Pose) -> list[str]:
    """Return digests of the objects that may be between a panorama and charts, and of the charts themselves."""
    place = np.array([pose.x, pose.y, pose.z])
    low, high = bounding_box(plan, charts)
    # what lies below both hides nothing: level ground does not count
    beside = np.array([OFF_PLANE_M, OFF_PLANE_M, -MIN_OCCLUDER_RISE_M])
    return plan.scene_objects.digests_in_box(np.minimum(low, place) - beside, np.maximum(high, place) + OFF_PLANE_M)


def bounding_box(plan: Plan, charts: Sequence[int]) -> tuple[Float64Array, Float64Array]:
    """Return the lower and upper corner (3,) of the box around some charts."""
    corners = plan.scene.charts.points_at_shares(np.array(charts), CORNER_SHARES)
    return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))


def view_own_textures(run: Run, plan: Plan, charts: Sequence[int], textures: Sequence[Path]) -> SceneView:
    """Return a view of charts with the textures that they carry: the place of each corner on its picture."""
    mesh = plan.scene.mesh
    found: list[object] = []
    for chart in charts:
        mine = mesh.chart_triangles(chart)
        pictures = [textures[i] if i >= 0 else None for i in mesh.texture[mine].tolist()]
        shape = mesh.vertices[mesh.triangles[mine]].tobytes() + mesh.uv[mine].tobytes()
        found.append((f"{plan.ids[chart]:016x}", blake2b(shape, digest_size=8).hexdigest(), *pictures))
    return SceneView(run, tuple(charts), tuple(found))


def textures_of_charts(plan: Plan, charts: Sequence[int], textures: Sequence[Path]) -> dict[int, Path]:
    """Return the texture pictures that some charts carry, by their number in the model."""
    used = plan.scene.mesh.texture[np.isin(plan.scene.mesh.chart, charts)]
    return {number: textures[number] for number in np.unique(used[used >= 0]).tolist()}
