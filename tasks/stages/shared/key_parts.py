"""Parts of keys that several stages share: each covers the inputs of a unit and nothing else of the block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import blake2b
from pathlib import Path

import numpy as np

from catalogs.block.digest import model_file_digests
from catalogs.file_digest import file_digest
from facade_core.core.arrays import Float64Array
from facade_core.core.lens_projection import lens_values
from facade_core.core.types import Pose, TrainedModelFiles
from facade_core.geometry.charts import CORNER_SHARES
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.stages.shared.surface_panorama import SurfacePanorama

# What of a block a panorama may be matched with, metres from where it was taken.
POSE_SURROUNDINGS_M = 150.0
# Geometry lies this far off the planes of its charts at most.
OFF_PLANE_M = 1.0
# What does not rise this far above the foot of a wall does not hide it.
MIN_OCCLUDER_RISE_M = 0.01


def material_digests(run: Run) -> list[object]:
    """Return name, scale and file digest of each of the block's material pictures."""
    return [[one.name, one.metres, file_digest(one.path)] for one in run.materials]


def model_key_parts(models: TrainedModelFiles) -> dict[str, object]:
    """Return the key part of a block's own models, if it has some."""
    return {"models": model_file_digests(models)} if models.files else {}


def panorama_key_parts(plan: Plan, charts_of: Mapping[SurfacePanorama, Sequence[int]]) -> dict[str, object]:
    """Return the key parts of panoramas: the pictures, the charts taken from each, and the objects between."""
    return {
        "panoramas": [
            [
                one.path.name,
                file_digest(one.path),
                pose_key_parts(one.pose),
                list(one.factor),
                one.squares,
                hex_chart_ids(plan, charts),
            ]
            for one, charts in charts_of.items()
        ],
        "between": [object_digests_between(plan, charts, one.pose) for one, charts in charts_of.items()],
    }


def hex_chart_ids(plan: Plan, charts: Sequence[int]) -> list[str]:
    """Return the ids of some charts as 16 hexadecimal digits."""
    return [f"{plan.ids[chart]:016x}" for chart in charts]


def pose_key_parts(pose: Pose) -> list[object]:
    """Return the key part of a pose: place, angles and view, and the lens of a perspective picture."""
    lens = [] if pose.lens is None else [lens_values(pose.lens)]
    return [pose.x, pose.y, pose.z, pose.heading, pose.pitch, pose.roll, list(pose.view), *lens]


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


def own_texture_key_parts(plan: Plan, charts: Sequence[int], textures: Sequence[Path]) -> list[object]:
    """Return the key part of the textures that some charts carry: the place of each corner on its picture."""
    mesh = plan.scene.mesh
    found: list[object] = []
    for chart in charts:
        mine = mesh.chart_triangles(chart)
        pictures = [file_digest(textures[i]) if i >= 0 else None for i in mesh.texture[mine].tolist()]
        shape = mesh.vertices[mesh.triangles[mine]].tobytes() + mesh.uv[mine].tobytes()
        found.append([f"{plan.ids[chart]:016x}", blake2b(shape, digest_size=8).hexdigest(), pictures])
    return found


def all_hex_chart_ids(plan: Plan) -> list[str]:
    """Return the ids of all charts of a plan as 16 hexadecimal digits."""
    return [f"{number:016x}" for number in plan.ids.tolist()]
