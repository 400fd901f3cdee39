"""Preview of a first run: a street with materials and exemplars, drawn before its facades are made."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.export.pictures.preview import draw_preview
from facade_core.export.pictures.rendering import cast_view, encode_image
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.export.pictures.views import choose_preview_camera
from tasks.engine.compute.connect import Compute
from tasks.engine.context import load_run_plan
from tasks.engine.outcome import error_reason
from tasks.engine.run import Run
from tasks.engine.unit import Unit
from tasks.stages.facades.exemplar_facades import build_wall_from_exemplar
from tasks.stages.facades.imagery import FacadeInputs
from tasks.stages.shared.materials import rebuild_material_field

log = logging.getLogger(__name__)

FILE = "preview.jpg"
# Density of the facades.
TEXELS_PER_METRE = 8.0


def draw_street_preview(run: Run, units: Sequence[Unit[FacadeInputs]]) -> bytes | None:
    """Draw a street with its materials and the exemplars of its facades as JPEG; None without a facade on a street.

    Parameters
    ----------
    run : the run.
    units : units of the facades, of which those in view are drawn.
    """
    plan, group = load_run_plan(run), open_root(open_repository(run.store).readonly_session(BRANCH))
    camera, materials = choose_preview_camera(plan, BLOCK_VIEWS.preview_size), rebuild_material_field(group, plan)
    if camera is None or materials is None:
        return None
    picture = cast_view(plan.scene, camera, samples=BLOCK_VIEWS.samples_per_pixel_side)
    seen = set(picture.visible_charts.tolist())
    facades = {}
    for unit in units:
        chart, sides = int(plan.facades.chart[unit.index]), (plan.facades.height, plan.facades.width)
        if chart in seen and unit.inputs.exemplar is not None:
            height, width = (max(1, round(TEXELS_PER_METRE * float(side[unit.index]))) for side in sides)
            if (facade := build_wall_from_exemplar(group, unit.index, unit.inputs, (height, width))) is not None:
                facades[chart] = facade.image
    return encode_image(draw_preview(picture, materials, facades), "JPEG", quality=85)


def start_preview(run: Run, units: Sequence[Unit[FacadeInputs]], compute: Compute, tell: Callable[[str], None]) -> None:
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
