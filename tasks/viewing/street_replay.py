"""Pictures of a street after any of its viewpoints, and panoramas."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np

from facade_core.atlas.rasters import read_rasters
from facade_core.core.arrays import Int32Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.geometry.raycast import MISS
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.street.lighting.sky import add_sky
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from tasks.engine.stage import is_done_record
from tasks.history import StreetState, street_after
from tasks.stages.shared.materials import rebuild_material_field
from tasks.viewing.run_view import RunView

# Height and width of the picture, pixels; RGB of untextured texels, of surfaces off the street and of the sky.
PICTURE_SIZE = (520, 960)
UNREACHED_RGB, OFF_STREET_RGB, SKY_RGB = (226, 222, 214), (188, 190, 194), (236, 240, 244)
# Camera behind and above the street's first viewpoint, looking down along the street.
BEHIND_M, ABOVE_M, FIELD_OF_VIEW_DEG = 14.0, 26.0, 70.0
# Width of panoramas, pixels.
PANORAMA_WIDTH = 1024


@dataclass(frozen=True)
class _LoadedRun:
    """Plan and materials of a run; its snapshots change, these do not."""

    view: RunView
    plan: Plan
    field: MaterialField


class StreetReplay:
    """Drawing of streets after any viewpoint, and of panoramas; the newest run stays cached."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._run: _LoadedRun | None = None

    def draw_after_viewpoint(self, view: RunView, viewpoint: int) -> UInt8Array:
        """Draw a viewpoint's street after that viewpoint from above, (h, w, 3) uint8.

        Raises
        ------
        InputError : the street is not textured yet.
        """
        street = _require_textured(view, viewpoint)
        with self._lock:
            run = self._load_run(view)
            step = [one.id for one in run.plan.street_viewpoints(street)].index(viewpoint)
            return _draw(street_after(run.plan, view.group, run.field, street, step), street)

    def draw_panorama(self, view: RunView, viewpoint: int) -> UInt8Array:
        """Return what a viewpoint sees of the finished textures, (h, w, 3) uint8.

        Raises
        ------
        InputError : the street is not textured yet.
        """
        _require_textured(view, viewpoint)
        with self._lock:
            plan = self._load_run(view).plan
            scene = plan.scene
            layout, writable = TexelBuffer.plan_layout(scene.placement, (), plan.charts_of_viewpoint(viewpoint))
            colour, provenance = (
                read_rasters(view.group[f"atlas/{name}"], scene.placement, layout) for name in ("colour", "provenance")
            )
            buffer = TexelBuffer.allocate(
                scene.placement, layout, writable, colour, provenance, visibility_range=scene.visibility_range
            )
            size = (PANORAMA_WIDTH // 2, PANORAMA_WIDTH)
            panorama = render_panorama(scene, buffer, plan.viewpoints[viewpoint], size)
            return add_sky(panorama.rgb, panorama.depth)

    def _load_run(self, view: RunView) -> _LoadedRun:
        if self._run is None or self._run.view.tables is not view.tables:
            plan = read_plan(view.session)
            self._run = _LoadedRun(view, plan, rebuild_material_field(view.group, plan))
        return self._run


def _require_textured(view: RunView, viewpoint: int) -> int:
    """Return the street of a viewpoint.

    Raises
    ------
    InputError : it is not textured yet.
    """
    street = int(view.tables.street[viewpoint])
    if not is_done_record(view.journals["streets"][street]):
        raise InputError(f"street {view.tables.streets[street]['id']} is not textured yet")
    return street


def _draw(state: StreetState, street: int) -> UInt8Array:
    """Draw the charts of a street from above."""
    scene = state.plan.scene
    places = np.array([viewpoint.position for viewpoint in state.plan.street_viewpoints(street)])
    along = (
        places[-1] - places[0] if len(places) > 1 else np.array([*state.plan.street_viewpoints(street)[0].forward, 0.0])
    )
    along[2] = 0.0
    along /= max(float(np.linalg.norm(along)), 1e-6)
    position = places[0] - BEHIND_M * along + [0.0, 0.0, ABOVE_M]
    camera = PerspectiveCamera(position, (places[0] + places[-1]) / 2 + 6.0 * along, FIELD_OF_VIEW_DEG, PICTURE_SIZE)
    rays = camera.rays()
    depth, shown = scene.caster.cast(camera.position, rays)
    picture = np.full((*PICTURE_SIZE, 3), SKY_RGB, np.uint8)
    picture[shown != MISS] = OFF_STREET_RGB
    for chart in np.intersect1d(shown, state.charts).tolist():
        on = shown == chart
        points = camera.position + rays[on] * depth[on][:, None]
        picture[on] = _texel_colours(state, chart, *scene.locate_texels(points, shown[on]))
    return picture


def _texel_colours(state: StreetState, chart: int, rows: Int32Array, columns: Int32Array) -> UInt8Array:
    """Return the colours (k, 3) of some texels of a chart, pale where nothing textured them."""
    colour, provenance = state.read_chart(chart)
    known = provenance[rows, columns] > Provenance.UNSEEN
    return np.where(known[:, None], colour[rows, columns], np.array(UNREACHED_RGB, np.uint8))
