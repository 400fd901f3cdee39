"""What a block's plan costs in processor seconds, by size: made, taken again for one photo more, and asked for what lies beside
a chart. And how much of the walls nobody can see, and what telling that takes.

python -m benchmarks.city.ingesting
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.city.blocks import write_block
from catalogs.block.reader import read_block
from facade_core.atlas.surroundings import coplanar_pieces
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.party_walls import find_enclosed_texels
from facade_core.street.surfaces import LEVELLING_MARGIN_M
from tasks.stages.ingest.planning import make_plan, update_plan_panoramas

SIZES = (1, 3)
# Charts that are asked for what lies beside them.
ASKED = 500


def measure(sizes: tuple[int, ...] = SIZES) -> dict[str, Any]:
    """By size of the block: charts, seconds, and shares."""
    found = {}
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            block = read_block(write_block(Path(folder) / "in", size))
            start = time.process_time()
            plan = make_plan(block)
            first = time.process_time() - start
            start = time.process_time()
            update_plan_panoramas(block, plan)
            again = time.process_time() - start
        charts = plan.scene.charts
        asked = np.linspace(0, len(charts) - 1, min(ASKED, len(charts))).astype(int).tolist()
        coplanar_pieces(charts, 0, LEVELLING_MARGIN_M)  # the tree is made once
        start = time.process_time()
        for chart in asked:
            coplanar_pieces(charts, chart, LEVELLING_MARGIN_M)
        beside = time.process_time() - start
        walls = np.flatnonzero(charts.kind == ChartKind.WALL).tolist()
        start = time.process_time()
        shut = sum(int(find_enclosed_texels(plan.scene, chart).sum()) for chart in walls)
        party = time.process_time() - start
        found[f"{size}x"] = {
            "facades": len(plan.facades),
            "viewpoints": len(plan.viewpoints),
            "charts": len(charts),
            "plan_s": round(first, 2),
            "plan_again_s": round(again, 2),
            "pieces_beside_ms": round(1000 * beside / len(asked), 3),
            "party_walls_of_walls": round(shut / int(plan.texel_counts()[walls].sum()), 3),
            "party_walls_s": round(party, 2),
        }
    return found


def main() -> None:
    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
