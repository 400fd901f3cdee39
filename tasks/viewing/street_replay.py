"""Pictures of a street after any of its viewpoints, and panoramas."""

from __future__ import annotations

import os
import threading
from dataclasses import dataclass

import numpy as np

from facade_core.atlas.journal import journal_path
from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.geometry.raycast import MISS
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.surfaces import paint_visible_texels
from tasks.stages.shared.materials import rebuild_material_field
from tasks.stages.streets.panoramas import read_base_layer, render_field_panorama
from tasks.stages.streets.worker import add_viewpoint_to_buffer, replay_street
from tasks.viewing.run_view import RunView

# Height and width of the picture, pixels; RGB of untextured texels, of surfaces off the street and of the sky.
PICTURE_SIZE = (520, 960)
UNREACHED_RGB, OFF_STREET_RGB, SKY_RGB = (226, 222, 214), (188, 190, 194), (236, 240, 244)
# Camera behind and above the street's first viewpoint, looking down along the street.
BEHIND_M, ABOVE_M, FIELD_OF_VIEW_DEG = 14.0, 26.0, 70.0
# All processors, because a person waits for the replay.
_THREADS = os.cpu_count() or 1


@dataclass(frozen=True)
class _LoadedRun:
    """Plan and materials of a run; its snapshots change, these do not."""

    view: RunView
    plan: Plan
    field: MaterialField | None


@dataclass
class _ReplayedStreet:
    """Street of the newest request.

    Attributes
    ----------
    steps : viewpoints in the buffer.
    texel : (h, w) texel of each pixel, -1 off the street and -2 for the sky.
    """

    run: _LoadedRun
    street: int
    buffer: TexelBuffer
    steps: int
    texel: Int64Array


class StreetReplay:
    """Drawing of streets after any viewpoint, and of panoramas; the newest run and street stay cached."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._run: _LoadedRun | None = None
        self._street: _ReplayedStreet | None = None

    def draw_after_viewpoint(self, view: RunView, viewpoint: int) -> UInt8Array:
        """Draw a viewpoint's street after that viewpoint from above, (h, w, 3) uint8.

        Raises
        ------
        InputError : the viewpoint is not textured yet.
        """
        street = int(view.tables.street[viewpoint])
        viewpoints = np.flatnonzero(view.tables.street == street)
        steps = int(np.searchsorted(viewpoints, viewpoint)) + 1
        with self._lock:
            run, replayed = self._load_run(view), self._street
            plan, field = run.plan, run.field
            if replayed is None or replayed.run is not run or replayed.street != street or replayed.steps > steps:
                _require_textured(view, viewpoint)
                window = replay_street(plan, view.group, street, steps, field=field is not None, threads=_THREADS)
                replayed = _ReplayedStreet(run, street, window, steps, _texels_in_picture(plan, window, street))
            for step in viewpoints[replayed.steps : steps].tolist():
                seen = plan.viewpoints[step]
                add_viewpoint_to_buffer(
                    plan, view.group, replayed.buffer, seen, field=field is not None, threads=_THREADS
                )
            if field is not None:
                paint_visible_texels(replayed.buffer, plan.scene.placement, field)
            replayed.steps = steps
            self._street = replayed
            return _draw(replayed)

    def draw_panorama(self, view: RunView, viewpoint: int) -> UInt8Array:
        """Return the panorama of a viewpoint, (h, w, 3) uint8: as the network made it, else rendered over the base layer.

        Raises
        ------
        InputError : the viewpoint is not textured yet.
        """
        _require_textured(view, viewpoint)
        stored = view.group["panoramas/rgb"]
        with self._lock:
            run = self._load_run(view)
            if run.field is None:
                return np.asarray(stored[viewpoint], np.uint8)
            seen = run.plan.viewpoints[viewpoint]
            buffer = read_base_layer(run.plan, view.group, run.plan.charts_of_viewpoint(viewpoint))
            return render_field_panorama(run.plan, buffer, run.field, seen, stored.shape[2])

    def _load_run(self, view: RunView) -> _LoadedRun:
        if self._run is None or self._run.view.tables is not view.tables:
            plan = read_plan(view.session)
            self._run = _LoadedRun(view, plan, rebuild_material_field(view.group, plan))
        return self._run


def _require_textured(view: RunView, viewpoint: int) -> None:
    if not view.group[journal_path("viewpoints")][viewpoint].item():
        street = int(view.tables.street[viewpoint])
        step = viewpoint - int(np.argmax(view.tables.street == street))
        raise InputError(f"viewpoint {step} of {view.tables.streets[street]['id']} is not textured yet")


def _texels_in_picture(plan: Plan, window: TexelBuffer, street: int) -> Int64Array:
    """Find the texel of the buffer behind each pixel of the picture, (h, w) int64."""
    scene = plan.scene
    places = np.array([viewpoint.position for viewpoint in plan.street_viewpoints(street)])
    along = places[-1] - places[0] if len(places) > 1 else np.array([*plan.street_viewpoints(street)[0].forward, 0.0])
    along[2] = 0.0
    along /= max(float(np.linalg.norm(along)), 1e-6)
    position = places[0] - BEHIND_M * along + [0.0, 0.0, ABOVE_M]
    camera = PerspectiveCamera(position, (places[0] + places[-1]) / 2 + 6.0 * along, FIELD_OF_VIEW_DEG, PICTURE_SIZE)
    rays = camera.rays()
    depth, chart = scene.caster.cast(camera.position, rays)
    texel = np.full(PICTURE_SIZE, -2, np.int64)
    hit = chart != MISS
    points = camera.position + rays[hit] * depth[hit][:, None]
    row, column = scene.locate_texels(points, chart[hit])
    offset = window.layout.offset[chart[hit]]
    texel[hit] = np.where(offset < 0, -1, offset + row.astype(np.int64) * scene.placement.width[chart[hit]] + column)
    return texel


def _draw(replayed: _ReplayedStreet) -> UInt8Array:
    window = replayed.buffer
    colour = np.where(
        (window.provenance == Provenance.UNSEEN)[:, None], np.array(UNREACHED_RGB, np.uint8), window.colour
    )
    return np.concatenate([colour, np.array([SKY_RGB, OFF_STREET_RGB], np.uint8)])[replayed.texel]
