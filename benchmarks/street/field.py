"""Ground painted where viewpoints see it, against all of it painted beforehand, and against panoramas projected onto it.

The embedded block's longest street, nothing but materials. Prints processor seconds of each way for the charts that it writes,
the share of their texels that it sees, and the gradient energy of seen ground over that of the field itself.

python -m benchmarks.street.field
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.block.reader import read_block
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.propagate import mark_first_visible, propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.surfaces import paint_visible_texels
from facade_core.street.translator.translators import MaterialFieldTranslator
from tasks.examples.demo import write_demo
from tasks.stages.ingest.planning import make_plan

PANORAMA = 1024


def measure() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        plan = make_plan(read_block(write_demo(Path(folder))))
    swatches = MaterialFieldTranslator(plan.scene, MaterialField(plan.scene, plan.streets, seed=1))
    longest = int(np.bincount(plan.viewpoint_streets).argmax())
    for ways in (_seen, _projected):  # compiles
        ways(plan, swatches, longest, 1)
    count = len(plan.street_viewpoints(longest))
    window, seconds = _seen(plan, swatches, longest, count)
    projected, seconds_projected = _projected(plan, swatches, longest, count)
    scene, writable = plan.scene, window.writable
    start = time.process_time()
    rasters = {chart: swatches.materials.chart_raster(chart) for chart in writable.tolist()}
    beforehand = time.process_time() - start
    ground = [chart for chart in writable.tolist() if scene.charts.kind[chart] == ChartKind.GROUND]
    energy = np.zeros(3)
    for chart in ground:
        texels = window.layout.texel_slice(scene.placement, chart)
        shape = rasters[chart].shape
        known = (window.state.views[texels] > 0).reshape(shape[:2])
        for way, colour in enumerate((rasters[chart], window.colour[texels], projected.colour[texels])):
            energy[way] += _gradient(colour.reshape(shape), known)
    seen = int((window.state.views > 0).sum())
    return {
        "viewpoints": count,
        "texels": len(window.state.views),
        "seen": round(seen / len(window.state.views), 3),
        "seconds": {
            "seen by each viewpoint": round(seconds["see"], 2),
            "seen, painted at the end": round(seconds["paint"], 2),
            "all painted beforehand": round(beforehand, 2),
            "panoramas projected": round(seconds_projected, 2),
        },
        "ns_a_texel": {
            "seen": round(1e9 * seconds["paint"] / max(seen, 1), 1),
            "beforehand": round(1e9 * beforehand / len(window.state.views), 1),
        },
        "gradient_of_ground": {
            "at texels": round(energy[1] / energy[0], 3),
            "projected": round(energy[2] / energy[0], 3),
        },
    }


def _window(plan: Plan, street: int) -> TexelBuffer:
    charts = plan.charts_of_street(street)
    rasters, writable = TexelBuffer.plan_layout(plan.scene.placement, charts[plan.writable[charts]], charts)
    blank = np.zeros((rasters.total, 3), np.uint8)
    return TexelBuffer.allocate(plan.scene.placement, rasters, writable, blank, blank[:, 0].copy())


def _seen(
    plan: Plan, swatches: MaterialFieldTranslator, street: int, count: int
) -> tuple[TexelBuffer, dict[str, float]]:
    window, seconds = _window(plan, street), 0.0
    for viewpoint in plan.street_viewpoints(street)[:count]:
        chart = plan.scene.cast_panorama(viewpoint, PANORAMA)[2]
        start = time.process_time()
        mark_first_visible(plan.scene, window, viewpoint, chart)
        seconds += time.process_time() - start
    start = time.process_time()
    paint_visible_texels(window, plan.scene.placement, swatches.materials)
    return window, {"see": seconds, "paint": time.process_time() - start}


def _projected(plan: Plan, swatches: MaterialFieldTranslator, street: int, count: int) -> tuple[TexelBuffer, float]:
    window, seconds = _window(plan, street), 0.0
    for viewpoint in plan.street_viewpoints(street)[:count]:
        panorama = render_panorama(plan.scene, window, viewpoint, (PANORAMA // 2, PANORAMA))
        rgb = swatches.translate(panorama)
        start = time.process_time()
        propagate_panorama(plan.scene, window, viewpoint, rgb, charts_seen=panorama.chart)
        seconds += time.process_time() - start
    return window, seconds


def _gradient(colour: np.ndarray, known: np.ndarray) -> float:
    """Sum of squared differences between neighbours of which both are known."""
    grey = colour.mean(axis=2)
    down = np.diff(grey, axis=0)[known[1:] & known[:-1]]
    right = np.diff(grey, axis=1)[known[:, 1:] & known[:, :-1]]
    return float((down**2).sum() + (right**2).sum())


def main() -> None:
    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
