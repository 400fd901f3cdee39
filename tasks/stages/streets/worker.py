"""Worker of `streets`: one viewpoint, and the end of a street. The panoramas are the truth; blend state is a cache."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Lock

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import read_records
from facade_core.atlas.rasters import TexelLayout, chart_digests, picture_digest, read_rasters, write_rasters
from facade_core.atlas.store import open_root
from facade_core.core.arrays import AnyArray, BoolArray, Int32Array, Int64Array, UInt8Array
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.blend import blend_views
from facade_core.street.propagation.propagate import mark_first_visible, propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.surfaces import paint_visible_texels
from facade_core.street.translator import neural_translator
from facade_core.street.translator.translators import MaterialFieldTranslator, Translator
from tasks.engine.context import current_worker_name, current_worker_threads, load_run_plan, reading_store
from tasks.engine.run import Run
from tasks.stages.shared.materials import material_field, pictured_ground, with_pictured_ground
from tasks.stages.shared.scene_view import StoredCharts
from tasks.stages.streets.panoramas import is_panorama_in_report, read_base_layer, render_field_panorama
from tasks.stages.streets.record import StreetRecord, StreetResult, ViewpointResult


@dataclass(frozen=True)
class StreetWorkerContext:
    """Plan and translator that a worker keeps between the units of a run.

    Attributes
    ----------
    plan : plan of the run.
    translator : translator of panoramas.
    field : material field of the translator; None if the translator returns pictures.
    """

    plan: Plan
    translator: Translator
    field: MaterialField | None


def load_street_worker_context(run: Run, group: StoreGroup) -> StreetWorkerContext:
    """Load the plan and the translator of a run, once per process and state of the pictured ground."""
    with reading_store(group):
        return _load_context(run, pictured_ground(run, load_run_plan(run), group))


@lru_cache(maxsize=2)
def _load_context(run: Run, pictured: StoredCharts) -> StreetWorkerContext:
    plan = load_run_plan(run)
    field = material_field(plan, run.seed, run.roof_material, run.materials)
    painter = MaterialFieldTranslator(plan.scene, with_pictured_ground(field, plan, pictured.store, pictured.charts))
    if run.texture.translator == "neural":
        network = neural_translator.load_colour_network(run.models.translator or neural_translator.SHIPPED_TRANSLATOR)
        return StreetWorkerContext(plan, neural_translator.NeuralTranslator(network, painter), None)
    return StreetWorkerContext(plan, painter, painter.materials)


@dataclass
class _Progress:
    """A street in this process: its texel buffer, and how many of its viewpoints it holds."""

    window: TexelBuffer
    done: int


# Seconds in which viewpoints begin that are committed together: where one takes a fraction of that, its commit would cost a
# third of it.
COMMIT_INTERVAL_S = 1.0

# A street of a run, by its key.
_Street = tuple[Run, int, str]
# One entry per street under way in this process, the newest last; dropped at the street's end, when a unit of another run
# comes, or as the oldest where there are more than threads.
# While a unit works on a window its own mark stands there: a second copy of a unit, come back to a worker whose first one was
# late, must not blend into the same window, and what a unit leaves that failed is not gone on from.
_streets: dict[_Street, _Progress | object] = {}
_taking = Lock()


def process_viewpoints(
    run: Run, fork: ForkSession, street: int, steps: Sequence[int], street_key: str
) -> tuple[ForkSession, list[ViewpointResult]]:
    """Texture viewpoints of a street: the first of `steps`, and those after it that begin within COMMIT_INTERVAL_S.

    Returns the fork with their panoramas and a record of each. A viewpoint that fails after others is left to the next unit, so
    that earlier results are kept.
    """
    begun = time.time()
    records: list[ViewpointResult] = []
    for step in steps:
        if records and time.time() - begun > COMMIT_INTERVAL_S:
            break
        try:
            records.append(_process_viewpoint(run, open_root(fork), street, step, street_key))
        except Exception:
            if not records:
                raise
            break
    return fork, records


def _process_viewpoint(run: Run, group: StoreGroup, street: int, step: int, street_key: str) -> ViewpointResult:
    """Texture one viewpoint: render, translate, propagate, store the panorama.

    With a material field no street reads the panorama: the texels in view are marked, and few panoramas are stored.
    """
    start = time.time()
    here = load_street_worker_context(run, group)
    entry = (run, street, street_key)
    # what a field answers does not depend on the viewpoints before, which the window need not have seen
    progress, mark = _take_buffer(entry, here, group, step if here.field is None else None)
    viewpoint = here.plan.street_viewpoints(street)[step]
    size = (run.texture.panorama_width // 2, run.texture.panorama_width)
    seconds: dict[str, float] = {"prepare": time.time() - start}
    clock = time.perf_counter()

    def lap(stage: str) -> None:
        nonlocal clock
        now = time.perf_counter()
        seconds[stage] = now - clock
        clock = now

    in_turn = progress.done == step
    passes, rgb = "", None
    if here.field is None:
        panorama = render_panorama(here.plan.scene, progress.window, viewpoint, size)
        lap("render")
        rgb = here.translator.translate(panorama)
        lap("translate")
        propagate_panorama(here.plan.scene, progress.window, viewpoint, rgb, charts_seen=panorama.chart)
        passes = _shared_pixels_digest(here.plan, panorama.chart, rgb)
        lap("propagate")
    else:
        # what others see of a field is told by the looks of viewpoints
        if in_turn:
            charts_seen = here.plan.scene.cast_panorama(viewpoint, size[1])[2]
            mark_first_visible(here.plan.scene, progress.window, viewpoint, charts_seen)
        lap("propagate")
        if is_panorama_in_report(here.plan, viewpoint):
            seen = read_base_layer(here.plan, group, here.plan.charts_of_viewpoint(viewpoint.id))
            rgb = render_field_panorama(here.plan, seen, here.field, viewpoint, size[1])
            lap("render")
    if rgb is not None:
        group["panoramas/rgb"][viewpoint.id] = rgb
        lap("write")
    _keep_buffer(entry, mark, _Progress(progress.window, step + 1 if in_turn else progress.done))
    result: ViewpointResult = {
        "passes": passes,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {stage: round(s, 4) for stage, s in seconds.items()},
    }
    return result if rgb is None else {**result, "panorama": picture_digest(rgb)}


def write_street_texels(
    run: Run, fork: ForkSession, street: int, steps: int, street_key: str
) -> tuple[ForkSession, StreetResult]:
    """Write the colour and view count of a street's charts after its `steps` viewpoints."""
    start = time.time()
    group = open_root(fork)
    here = load_street_worker_context(run, group)
    window = _take_buffer((run, street, street_key), here, group, steps)[0].window
    with _taking:
        _streets.pop((run, street, street_key), None)
    scene = here.plan.scene
    rasters = TexelLayout.of_charts(scene.placement, window.writable)
    if here.field is None:
        colour, views = blend_views(window.state)
    else:
        for viewpoint in _earlier_viewpoints(here.plan, group, street, window.writable):
            add_viewpoint_to_buffer(here.plan, group, window, viewpoint, field=True)
        paint_visible_texels(window, scene.placement, here.field)
        views = window.state.views
        colour = np.where((views > 0)[:, None], window.colour[: rasters.total], np.uint8(0))
    written = replace(rasters, charts=rasters.charts[~_written_by_later(here.plan, group, street, rasters.charts)])
    arrays: dict[str, AnyArray] = {"street": colour, "street_views": views}
    for name, flat in arrays.items():
        write_rasters(group[f"atlas/{name}"], scene.spec, scene.placement, written, flat)
    return fork, {
        "digests": chart_digests(colour, views, scene.placement, rasters, here.plan.ids),
        "texels": int((views > 0).sum()),
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"write": round(time.time() - start, 4)},
    }


def _shared_pixels_digest(plan: Plan, chart: Int32Array, rgb: UInt8Array) -> str:
    """Return a digest of the pixels of a panorama that other streets may blend: those on charts of the street stage."""
    shared = (chart >= 0) & plan.writable[chart]
    return picture_digest(np.where(shared[..., None], rgb, np.uint8(0)))


def _written_by_later(plan: Plan, group: StoreGroup, street: int, charts: Int64Array) -> BoolArray:
    """Return which charts (k,) of a street hold texels of a later wave, (k,) bool.

    Those are blended from more views, or will be once that street is done again.
    """
    pairs = plan.select_street_chart_pairs(charts)
    pairs = pairs[plan.wave[pairs[:, 0]] > plan.wave[street]]
    later = np.unique(pairs[:, 0])
    records = dict(zip(later.tolist(), read_records(group, "streets", later, StreetRecord), strict=True))
    held = [
        chart
        for other, chart in pairs.tolist()
        if (record := records[other]) and record["status"] == "done" and f"{plan.ids[chart]:016x}" in record["digests"]
    ]
    return np.isin(charts, held)


def _take_buffer(
    entry: _Street, here: StreetWorkerContext, group: StoreGroup, step: int | None
) -> tuple[_Progress, object]:
    """Take the street's buffer with its first `step` viewpoints, None for any number, from this process or by replay.

    Also returns the mark that is stored in its place. With a material field the panoramas of other streets are left out: only
    the end of the street needs them.
    """
    mark = object()
    with _taking:
        for other in [held for held in _streets if held[0] != entry[0]]:
            del _streets[other]
        held = _streets.pop(entry, None)
        _streets[entry] = mark
        for oldest in list(_streets)[: -current_worker_threads()]:
            del _streets[oldest]
    if not isinstance(held, _Progress) or step not in (None, held.done):
        steps = step or 0
        if here.field is None:
            window = replay_street(here.plan, group, entry[1], steps, field=False)
        else:
            window = _replay_visibility(here.plan, group, entry[1], steps)
        held = _Progress(window, steps)
    return held, mark


def _keep_buffer(entry: _Street, mark: object, progress: _Progress) -> None:
    with _taking:
        if _streets.get(entry) is mark:
            _streets[entry] = progress


def replay_street(
    plan: Plan, group: StoreGroup, street: int, step: int, *, field: bool, threads: int = 1
) -> TexelBuffer:
    """Rebuild a street's texel buffer after its first `step` viewpoints.

    It holds the base layer, the panoramas of earlier waves that show its charts, and its own.

    Parameters
    ----------
    field : whether the translator returns a material field; its texels are left to `paint_visible_texels`.
    threads : threads of the kernels.
    """
    window = read_base_layer(plan, group, plan.charts_of_street(street))
    own = plan.street_viewpoints(street)[:step]
    for viewpoint in [*_earlier_viewpoints(plan, group, street, window.writable), *own]:
        add_viewpoint_to_buffer(plan, group, window, viewpoint, field=field, threads=threads)
    return window


def _replay_visibility(plan: Plan, group: StoreGroup, street: int, step: int) -> TexelBuffer:
    """Rebuild which texels of a street its first `step` viewpoints see: only charts that it writes, without their colours.

    That is all that a material field needs before the end of a street.
    """
    scene, charts = plan.scene, plan.charts_of_street(street)
    rasters, writable = TexelBuffer.plan_layout(scene.placement, charts[plan.writable[charts]], ())
    evidence = read_rasters(group["atlas/seed_evidence"], scene.placement, rasters)
    window = TexelBuffer.allocate(
        scene.placement,
        rasters,
        writable,
        np.zeros((rasters.total, 3), np.uint8),
        evidence,
        visibility_range=scene.visibility_range,
    )
    for viewpoint in plan.street_viewpoints(street)[:step]:
        add_viewpoint_to_buffer(plan, group, window, viewpoint, field=True)
    return window


def _earlier_viewpoints(plan: Plan, group: StoreGroup, street: int, charts: Int64Array) -> list[Viewpoint]:
    """Return the viewpoints of earlier waves that are done and show some charts (k,)."""
    shows = np.unique(plan.select_view_rows(charts)[:, 0]).astype(np.int64)
    shows = shows[plan.wave[plan.viewpoint_streets[shows]] < plan.wave[street]]
    records = read_records(group, "viewpoints", shows)
    return [
        plan.viewpoints[v] for v, record in zip(shows, records, strict=True) if record and record["status"] == "done"
    ]


def add_viewpoint_to_buffer(
    plan: Plan, group: StoreGroup, window: TexelBuffer, viewpoint: Viewpoint, *, field: bool, threads: int = 1
) -> None:
    """Add a finished viewpoint to a texel buffer: its panorama, or its visibility."""
    if field:
        mark_first_visible(
            plan.scene, window, viewpoint, plan.scene.cast_panorama(viewpoint, group["panoramas/rgb"].shape[2])[2]
        )
    else:
        propagate_panorama(plan.scene, window, viewpoint, group["panoramas/rgb"][viewpoint.id], threads=threads)
