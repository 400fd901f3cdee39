"""What the geometry of the example blocks gives."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

BLOCKS = ("amsterdam-dam", "amsterdam-ij", "delfshaven", "ingolstadt", "plateau")


def main() -> None:
    """Plan the example blocks; prints one JSON object."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="the data folder")
    parser.add_argument("--only", choices=("blocks",), help="the one part there is")
    options = parser.parse_args()
    os.environ["STREETLOOM_DATA"] = str(options.data.resolve())
    blocks = [_block(name) for name in BLOCKS]
    totals = {name: sum(block[name] for block in blocks) for name in ("viewpoints", "viewpoints_inside_buildings")}
    print(json.dumps({"benchmark": "readers", "blocks": blocks, "all_blocks": totals}, indent=1))


def _block(name: str) -> dict[str, Any]:
    """What the geometry of an example block gives: heights by source, viewpoints, walls that a street owns."""
    import shapely

    from catalogs.block.reader import read_block
    from catalogs.block.settings import replace_settings
    from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER as FOLDER
    from facade_core.geometry.charts import ChartKind
    from tasks.stages.ingest.planning import make_plan

    start = time.perf_counter()
    block = read_block(FOLDER / f"{name}.yaml")
    read = time.perf_counter() - start
    plan = make_plan(replace(block, settings=replace_settings(block.settings, panorama_width=512)))
    charts, facades = plan.scene.charts, plan.facades
    footprints = shapely.union_all([building.footprint for building in block.buildings])
    places = shapely.points([viewpoint.position[:2] for viewpoint in plan.viewpoints])
    normal = charts.normals()
    middle = charts.points(np.arange(len(charts)), *charts.size.T / 2)
    before = shapely.points((middle + 0.5 * normal)[:, :2])
    large = (charts.kind == ChartKind.WALL) & (charts.size[:, 0] >= 3.0) & (charts.size[:, 1] >= 2.5)
    free = large & ~shapely.intersects(footprints, before)
    owned = np.zeros(len(charts), bool)
    owned[facades.chart] = True
    return {
        "block": name,
        "buildings": len(block.buildings),
        "heights_by_source": dict(Counter(building.height_source for building in block.buildings)),
        "set_aside": len(block.faults),
        "streets": len(plan.streets),
        "streets_derived": not block.streets,
        "street_metres": round(sum(street.line.length for street in plan.streets)),
        "viewpoints": len(plan.viewpoints),
        "viewpoints_inside_buildings": int(shapely.intersects(footprints, places).sum()),
        "walls": int(large.sum()),
        "walls_with_a_street": int(owned.sum()),
        "walls_in_the_open": int(free.sum()),
        "share_in_the_open_with_a_street": round(float((owned & free).sum() / max(1, free.sum())), 3),
        "facades_shown_by_panoramas": len(np.unique(plan.sightings.facade)),
        "seconds_read": round(read, 2),
        "seconds_plan": round(time.perf_counter() - start - read, 2),
        "pages": plan.scene.spec.pages,
    }


if __name__ == "__main__":
    main()
