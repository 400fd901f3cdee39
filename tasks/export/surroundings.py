"""What stands and lies around a published block, for models."""

from __future__ import annotations

from facade_core.core.arrays import IntArray
from facade_core.core.street_objects import NO_OBJECTS
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS
from facade_core.export.models.textured_mesh import ModelFrame
from facade_core.export.surroundings.gltf import SurroundingModel
from tasks.publish.published_run import PublishedBlock


def build_surrounding_model(
    results: PublishedBlock, shown: IntArray, frame: ModelFrame, *, is_unlit: bool = True, is_instanced: bool = False
) -> SurroundingModel:
    """Build the model of what stands around some buildings (n,): nothing without the ground, -1."""
    around = (results.plan.objects, results.plan.surroundings) if -1 in shown else (NO_OBJECTS, NO_SURROUNDINGS)
    return SurroundingModel(*around, frame, is_unlit, is_instanced)
