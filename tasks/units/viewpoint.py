"""One viewpoint of a street, and the street's end. The truth is the translated panoramas; blend state is only a cache."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import zarr

from facade_core.atlas.levelling import LEVELLED_M, level
from facade_core.atlas.provenance import TRANSLATED
from facade_core.atlas.rasters import Rasters, chunk_digests, read_rasters, write_rasters
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.ingest import Plan
from facade_core.street.blend import blend
from facade_core.street.propagate import propagate
from facade_core.street.render import render
from facade_core.street.scene import Scene
from facade_core.street.window import Window
from tasks.run import Run
from tasks.units.context import Context, context, worker_name


@dataclass
class _Progress:
    """A street in this process: its window and how many of its viewpoints are in it."""

    window: Window
    done: int


# One entry per street under way in this process; dropped at the street's end, or when a unit of another run comes.
_streets: dict[tuple[Run, int, str], _Progress] = {}


def viewpoint_unit(run: Run, fork: Any, street: int, step: int, street_key: str) -> tuple[Any, dict[str, Any]]:
    """Texture the `step`-th viewpoint of a street: render, translate, propagate, write the panorama through the fork."""
    start = time.time()
    here = context(run)
    group: StoreGroup = zarr.open_group(fork.store)
    progress = _progress(run, here, group, street, step, street_key)
    viewpoint = here.plan.of_street(street)[step]
    size = (run.panorama_width // 2, run.panorama_width)
    seconds: dict[str, float] = {"prepare": time.time() - start}
    clock = time.perf_counter()

    def lap(stage: str) -> None:
        nonlocal clock
        now = time.perf_counter()
        seconds[stage] = now - clock
        clock = now

    panorama = render(here.plan.scene, progress.window, viewpoint, size)
    lap("render")
    rgb = here.translator.translate(panorama)
    lap("translate")
    propagate(here.plan.scene, progress.window, viewpoint, rgb, seen=panorama.chart)
    progress.done = step + 1
    lap("propagate")
    group["panoramas/rgb"][viewpoint.id] = rgb
    lap("write")
    return fork, {
        "textured": round(float(panorama.textured[panorama.chart >= 0].mean()), 4)
        if (panorama.chart >= 0).any()
        else 0.0,
        "worker": worker_name(),
        "started": start,
        "seconds": {stage: round(s, 4) for stage, s in seconds.items()},
    }


def street_unit(run: Run, fork: Any, street: int, steps: int, street_key: str) -> tuple[Any, dict[str, Any]]:
    """Write what the street's `steps` viewpoints made of its charts: street colour, views, resolved colour, provenance."""
    start = time.time()
    here = context(run)
    group: StoreGroup = zarr.open_group(fork.store)
    window = _progress(run, here, group, street, steps, street_key).window
    _streets.pop((run, street, street_key), None)
    scene = here.plan.scene
    colour, views = blend(window.state)
    held = Rasters.of(scene.placement, window.writable)
    atlas = group["atlas"]
    for name, flat in {
        "street": colour,
        "street_views": views,
        "colour": _levelled(scene, held, window),
        "provenance": window.provenance[: held.total],
    }.items():
        write_rasters(atlas[name], scene.spec, scene.placement, held, flat)
    return fork, {
        "chunks": chunk_digests(atlas["colour"], atlas["provenance"], scene.spec, scene.placement, window.writable),
        "texels": int((views > 0).sum()),
        "worker": worker_name(),
        "started": start,
        "seconds": {"write": round(time.time() - start, 4)},
    }


def _levelled(scene: Scene, held: Rasters, window: Window) -> np.ndarray:
    """The colour of the charts that the street writes, what it translated levelled to what the facade stages know."""
    placement, reach = scene.placement, LEVELLED_M * scene.spec.texels_per_metre
    colour = window.colour[: held.total].copy()
    for chart in held.charts.tolist():
        texels = held.slice(placement, chart)
        provenance = window.provenance[texels]
        if provenance.max() <= TRANSLATED or not (provenance == TRANSLATED).any():
            continue
        shape = (int(placement.height[chart]), int(placement.width[chart]))
        provenance, raster = provenance.reshape(shape), colour[texels].reshape(*shape, 3)
        colour[texels] = level(raster, provenance > TRANSLATED, provenance == TRANSLATED, reach=reach).reshape(-1, 3)
    return colour


def _progress(run: Run, here: Context, group: StoreGroup, street: int, step: int, street_key: str) -> _Progress:
    """The street's window with its first `step` viewpoints in it: from this process, else replayed from panoramas."""
    entry = (run, street, street_key)
    for other in [held for held in list(_streets) if held[0] != run]:
        _streets.pop(other, None)
    if entry not in _streets or _streets[entry].done != step:
        _streets[entry] = _Progress(replay(here.plan, group, street, step), step)
    return _streets[entry]


def replay(plan: Plan, group: StoreGroup, street: int, step: int) -> Window:
    """A street's window after its first `step` viewpoints: seeds, every panorama of earlier waves that shows one of its
    charts, then the street's own."""
    scene = plan.scene
    own = plan.of_street(street)
    is_own = np.isin(plan.views[:, 0], [v.id for v in own])
    charts = np.unique(plan.views[is_own, 1])
    rasters, writable = Window.layout(scene.placement, charts[plan.writable[charts]], charts)
    atlas = group["atlas"]
    seed, evidence = (read_rasters(atlas[name], scene.placement, rasters) for name in ("seed", "seed_evidence"))
    window = Window.of(scene.placement, rasters, writable, seed, evidence, visibility_range=scene.visibility_range)

    shows = np.unique(plan.views[np.isin(plan.views[:, 1], writable), 0])
    earlier = [plan.viewpoints[v] for v in shows if plan.wave[plan.viewpoints[v].street] < plan.wave[street]]
    for viewpoint in [*earlier, *own[:step]]:
        propagate(scene, window, viewpoint, group["panoramas/rgb"][viewpoint.id])
    return window
