"""Preview of a first run: a street with materials and exemplars, drawn before its facades are made."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.arrays import UInt8Array
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.preview import PREVIEW_SIZE, draw_preview, visible_charts
from facade_core.export.pictures.rendering import encode_image
from facade_core.export.pictures.views import choose_preview_camera
from facade_core.facade.exemplar_facade import BuildingPaint, ScaledStyle, build_facade_from_exemplar
from facade_core.plan.facade_walls import facade_wall
from facade_core.plan.plan import Plan
from tasks.engine.compute.connect import Compute
from tasks.engine.context import load_run_plan
from tasks.engine.outcome import error_reason
from tasks.engine.run import Run
from tasks.engine.seeds import BUILDING_SEED, FACADE_SEED, unit_seed
from tasks.engine.unit import Unit
from tasks.stages.facades.analysed_exemplars import load_exemplar_analysis
from tasks.stages.shared.materials import rebuild_material_field

log = logging.getLogger(__name__)

FILE = "preview.jpg"
# Density of the facades.
TEXELS_PER_METRE = 8.0


def draw_street_preview(run: Run, units: Sequence[Unit]) -> bytes | None:
    """Draw a street with its materials and the exemplars of its facades as JPEG; None without a facade on a street.

    Parameters
    ----------
    run : the run.
    units : units of the facades, of which those in view are drawn.
    """
    plan, group = load_run_plan(run), open_root(open_repository(run.store).readonly_session(BRANCH))
    camera, materials = choose_preview_camera(plan, PREVIEW_SIZE), rebuild_material_field(group, plan)
    if camera is None or materials is None:
        return None
    seen = set(visible_charts(plan, camera).tolist())
    facades = {}
    for unit in units:
        chart = int(plan.facades.chart[unit.index])
        if chart in seen and unit.arguments[0].exemplar is not None:
            facades[chart] = _draw_coarse_facade(run, plan, group, unit)
    return encode_image(draw_preview(plan, materials, camera, facades), "JPEG", quality=85)


def _draw_coarse_facade(run: Run, plan: Plan, group: StoreGroup, unit: Unit) -> UInt8Array:
    """Return the texture of a facade in the style of its exemplar, (h, w, 3) uint8."""
    facades, imagery, number = plan.facades, unit.arguments[0], unit.index
    style, metres_per_texel = load_exemplar_analysis(run, group, imagery.exemplar[0], shops=imagery.shops)
    along, width, height = (float(column[number]) for column in (facades.along, facades.width, facades.height))
    size = (max(1, round(height * TEXELS_PER_METRE)), max(1, round(width * TEXELS_PER_METRE)))
    wall = facade_wall(plan.scene, facades, number, imagery.entrances)
    return build_facade_from_exemplar(
        ScaledStyle(style, metres_per_texel),
        wall,
        size,
        span=(along, along + width),
        paint=BuildingPaint(unit_seed(run, str(facades.house[number]), BUILDING_SEED)),
        seed=unit_seed(run, facades.id[int(facades.run[number])], FACADE_SEED),
    ).image


def start_preview(run: Run, units: Sequence[Unit], compute: Compute, tell: Callable[[str], None]) -> None:
    """Draw the preview on a worker beside other units, write it into the run's folder, and tell where it is.

    A preview that fails is logged, and ends nothing.
    """
    unit = compute.submit(draw_street_preview, run, units)
    path = Path(run.local) / FILE

    def finish() -> None:
        try:
            data = unit.result()
            if data is None:
                return
            draft = path.with_suffix(".tmp")
            draft.write_bytes(data)
            draft.replace(path)
        except Exception as error:
            log.warning("no preview was drawn: %s", error_reason(error))
        else:
            tell(f"preview: {path} (materials and exemplars, without sun and shadows; the textures follow)")

    threading.Thread(target=finish, name="preview", daemon=True).start()
