"""Painted renderings of streets for training the translator: procedural streets, and streets of finished runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from benchmarks.painter.street_truth import synthetic_street
from benchmarks.papers.translator.crops import PANORAMA_HEIGHT, TrainingRendering
from benchmarks.papers.translator.translators import MaterialFieldTranslator, paint_bare_pixels
from facade_core.atlas.rasters import read_rasters
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.arrays import IntArray, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.core.types import Street
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.street.lighting.sky import add_sky
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import RenderedPanorama, render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from tasks.engine.progress import begin_stage, report_progress
from tasks.stages.shared.materials import rebuild_material_field

# Consecutive viewpoints of a sequence of a run's street.
VIEWPOINTS_PER_SEQUENCE = 4
SEQUENCES_PER_RUN = 24
PROCEDURAL_STREETS = 8
# Validation takes every n-th sequence.
VALIDATION_STRIDE = 5
_SPACING_M = 5.0
_CAMERA_HEIGHT_M = 2.5
_SIZE = (PANORAMA_HEIGHT, 2 * PANORAMA_HEIGHT)


def render_training_views(
    runs: Sequence[Path], *, seed: int
) -> tuple[list[TrainingRendering], list[TrainingRendering]]:
    """Render viewpoints of procedural streets and of finished runs for training and for validation."""
    begin_stage("renderings", SEQUENCES_PER_RUN * len(runs) + PROCEDURAL_STREETS)
    sequences: list[list[TrainingRendering]] = []
    for number in range(PROCEDURAL_STREETS):
        sequences.append(render_procedural_street(seed=100 * seed + number, bare=number % 2 == 0))
        report_progress("renderings", 1)
    for run in runs:
        for sequence in render_run_sequences(run, SEQUENCES_PER_RUN, seed=seed):
            sequences.append(sequence)
            report_progress("renderings", 1)
    learnt = [view for number, one in enumerate(sequences) if number % VALIDATION_STRIDE for view in one]
    judged = [view for number, one in enumerate(sequences) if number % VALIDATION_STRIDE == 0 for view in one]
    return learnt, judged


def render_procedural_street(*, seed: int, bare: bool) -> list[TrainingRendering]:
    """Render a street with painted facades, or with bare walls."""
    street = synthetic_street(8, seed=seed, occluders=0, texels_per_metre=20.0)
    line = shapely.LineString([street.world_point(along, 0.0) for along in (0.0, street.length)])
    painter = MaterialFieldTranslator(
        street.scene, MaterialField(street.scene, [Street("street", None, line)], seed=seed)
    )
    viewpoints = []
    for number, along in enumerate(np.arange(_SPACING_M / 2, street.length, _SPACING_M)):
        x, y = street.world_point(float(along), 0.0)
        viewpoints.append(Viewpoint(number, 0, np.array([x, y, _CAMERA_HEIGHT_M]), street.axis))
    given = {} if bare else {c: f.image for c, f in zip(street.charts, street.facades, strict=True)}

    def make_buffer() -> TexelBuffer:
        charts = np.arange(len(street.scene.charts))
        return _allocate_buffer(street.scene, charts, given)

    return render_sequence(street.scene, viewpoints, (make_buffer(), make_buffer()), painter.translate)


def render_run_sequences(run: Path, count: int, *, seed: int) -> Iterator[list[TrainingRendering]]:
    """Render sequences of viewpoints along the streets of a run, those that show most walls first.

    Raises
    ------
    InputError : the folder has no finished run.
    """
    if not (run / "store").is_dir():
        raise InputError(f"{run}: no run of a block; name the folder that one was written to")
    session = open_repository(run / "store").readonly_session(BRANCH)
    group, plan = open_root(session), read_plan(session)
    field = rebuild_material_field(group, plan)
    paint = partial(paint_bare_pixels, materials=field, normals=plan.scene.charts.normals())
    rng = np.random.default_rng(seed)
    wall = plan.scene.charts.kind == ChartKind.WALL
    shown = np.bincount(plan.views[wall[plan.views[:, 1]], 0], minlength=len(plan.viewpoints))
    starts = []
    for street in range(len(plan.streets)):
        viewpoints = plan.street_viewpoints(street)
        for first in range(0, len(viewpoints) - VIEWPOINTS_PER_SEQUENCE + 1, VIEWPOINTS_PER_SEQUENCE):
            part = viewpoints[first : first + VIEWPOINTS_PER_SEQUENCE]
            starts.append((int(shown[[v.id for v in part]].min()), street, first))
    # sampling the better half skips open places without preferring the narrowest streets
    better = sorted(starts, reverse=True)[: max(count, len(starts) // 2)]
    for number in rng.permutation(len(better))[:count].tolist():
        _, street, first = better[number]
        viewpoints = plan.street_viewpoints(street)[first : first + VIEWPOINTS_PER_SEQUENCE]
        charts = np.unique(np.concatenate([plan.charts_of_viewpoint(v.id) for v in viewpoints]))
        buffers = (read_base_layer(plan, group, charts), read_base_layer(plan, group, charts))
        yield render_sequence(plan.scene, viewpoints, buffers, paint)


def read_base_layer(plan: Plan, group: StoreGroup, charts: IntArray) -> TexelBuffer:
    """Read the base layer of some charts (k,) into a buffer without any view."""
    scene = plan.scene
    layout, writable = TexelBuffer.plan_layout(scene.placement, charts[plan.writable[charts]], charts)
    colour, provenance = (
        read_rasters(group[f"atlas/{name}"], scene.placement, layout) for name in ("seed", "seed_evidence")
    )
    return TexelBuffer.allocate(
        scene.placement, layout, writable, colour, provenance, visibility_range=scene.visibility_range
    )


def render_sequence(
    scene: Scene,
    viewpoints: Sequence[Viewpoint],
    buffers: tuple[TexelBuffer, TexelBuffer],
    paint: Callable[[RenderedPanorama], UInt8Array],
) -> list[TrainingRendering]:
    """Render viewpoints of one street in order, each with what its predecessors have translated.

    Parameters
    ----------
    scene : the block's geometry.
    viewpoints : viewpoints of the street.
    buffers : the given texels, twice; the second takes what the viewpoints see.
    paint : paints the untextured pixels of a panorama.
    """
    given, taken = buffers
    renderings = []
    for viewpoint in viewpoints:
        panorama = render_panorama(scene, given, viewpoint, _SIZE)
        sky = np.isinf(panorama.depth)
        image = add_sky(paint(panorama), panorama.depth)
        known = render_panorama(scene, taken, viewpoint, _SIZE).textured
        renderings.append(TrainingRendering(image, panorama.textured | sky, known & ~panorama.textured))
        propagate_panorama(scene, taken, viewpoint, image, charts_seen=panorama.chart)
    return renderings


def _allocate_buffer(scene: Scene, charts: np.ndarray, given: dict[int, UInt8Array]) -> TexelBuffer:
    """Allocate a buffer in which some charts have the texture of an image."""
    import cv2

    placement = scene.placement
    rasters, write = TexelBuffer.plan_layout(placement, charts, charts)
    colour, provenance = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    for chart, image in given.items():
        size = (int(placement.width[chart]), int(placement.height[chart]))
        texels = rasters.texel_slice(placement, chart)
        colour[texels] = cv2.resize(image, size, interpolation=cv2.INTER_AREA).reshape(-1, 3)
        provenance[texels] = Provenance.PHOTO
    return TexelBuffer.allocate(placement, rasters, write, colour, provenance, visibility_range=scene.visibility_range)
