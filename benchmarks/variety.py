"""How varied a published block is, and what sharper texels would cost: `python -m benchmarks.variety --out DIR` prints JSON.

exemplars: of the facades without imagery, how many exemplars they show, how many facades the most frequent one is on, pairs of
buildings with walls within 60 m that share one, and the share that shows shops. fronts and twins, compared by their pictures:
benchmarks/look. texels: millions of all charts at a density for all, and by steps: of what a street shows from near, of other
walls, of roofs and what lies behind; store_bytes, of a texel, are what chunks of this store take now.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks.look import walls
from benchmarks.look.outputs import Output, read_output
from facade_core.geometry.charts import CORNERS, WALL
from facade_core.style import NEIGHBOURS_M

DENSITIES = (16.0, 20.0, 32.0)
# Texels a metre: of walls that a street passes and ground beside it, of other walls and ground near it, and of the rest.
STEPS = (32.0, 16.0, 8.0)
PASSED_M, NEAR_M = 15.0, 40.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.variety", description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of a run that has published")
    output = read_output(parser.parse_args().out)
    figures = {
        "benchmark": "variety",
        "exemplars": _exemplars(output),
        "fronts": walls.fronts(output),
        "twins": walls.twins(output),
        "texels": _texels(output),
    }
    print(json.dumps(figures, indent=1))


def _exemplars(output: Output) -> dict[str, Any]:
    rows = output.items[output.items.photo == 0].reset_index()
    lines = {facade.id: _foot(output, facade.chart) for facade in output.facades}
    rows = rows[rows.id.isin(list(lines))]
    near = shapely.STRtree([lines[id] for id in rows.id])
    one, other = near.query(near.geometries, predicate="dwithin", distance=NEIGHBOURS_M)
    pairs = {
        tuple(sorted((rows.building.iloc[a], rows.building.iloc[b])))
        for a, b in zip(one.tolist(), other.tolist(), strict=True)
        if rows.building.iloc[a] != rows.building.iloc[b] and rows.source.iloc[a] == rows.source.iloc[b]
    }
    uses = rows.source.value_counts()
    by_building = rows.drop_duplicates(["building", "source"]).source.value_counts()
    return {
        "facades": len(rows),
        "exemplars": len(uses),
        "facades_of_the_most_used": int(uses.max()) if len(uses) else 0,
        "buildings_of_the_most_used": int(by_building.max()) if len(uses) else 0,
        "neighbours_of_one_exemplar": len(pairs),
        "with_shops": int((rows.shops > 0).sum()),
    }


def _texels(output: Output) -> dict[str, Any]:
    charts, area = output.charts, output.charts.size.prod(axis=1)
    low_and_high = charts.at_shares(np.arange(len(charts)), CORNERS)[..., :2]
    boxes = shapely.box(*low_and_high.min(axis=1).T, *low_and_high.max(axis=1).T)
    away = shapely.distance(boxes, shapely.union_all(list(output.streets)))
    fronts = np.zeros(len(charts), bool)
    fronts[[facade.chart for facade in output.facades]] = True
    upright = charts.kind == WALL
    passed = (fronts & (away <= PASSED_M)) | (~upright & (charts.building < 0) & (away <= PASSED_M))
    near = (upright | (charts.building < 0)) & (away <= NEAR_M)
    density = np.select([passed, near], STEPS[:2], STEPS[2])
    chunks = sum(path.stat().st_size for path in (output.snapshot.out / "store" / "chunks").iterdir())
    texels = float((area * output.density**2).sum())
    return {
        "charts": len(charts),
        **{f"at_{step:g}": round(float(area.sum() * step**2) / 1e6, 1) for step in DENSITIES},
        "by_steps": round(float((area * density**2).sum()) / 1e6, 1),
        "share_of_area_at_each_step": [round(float(area[density == step].sum() / area.sum()), 3) for step in STEPS],
        "store_bytes": round(chunks / texels, 2),
    }


def _foot(output: Output, chart: int) -> shapely.LineString:
    ends = output.charts.at_shares(np.array([chart]), np.array([[0.0, 1.0], [1.0, 1.0]]))[0, :, :2]
    return shapely.LineString(ends)


if __name__ == "__main__":
    main()
