"""How varied a published block is, and what sharper texels would cost: `python -m benchmarks.variety --out DIR` prints JSON.

With --block FILE it prints `exemplars` and `texels` for a block file alone, as its exemplars would be chosen now; seconds of
the processor, to prepare one (median).

exemplars: of the facades without imagery, how many exemplars they show, how many facades the most frequent one is on, pairs of
buildings with walls within 60 m that share one, and the share that shows shops; of a block file also shares of style families
and of shops, among exemplars and on buildings, and half the sum of the families' differences. fronts and twins, compared by
their pictures: benchmarks/look. texels: millions of all charts were they at one density, and now, by density; store_bytes, of a
texel, are what chunks of this store take.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import shapely

from benchmarks.look import walls
from benchmarks.look.outputs import Output, read_output
from catalogs.block.reader import Block, read_block
from facade_core.core.labels import FacadeClass
from facade_core.facade.exemplar import prepare_exemplar
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.geometry.charts import Charts
from facade_core.plan.exemplar_choice import NEIGHBOURHOOD_M
from facade_core.plan.exemplar_style import style_descriptor
from facade_core.plan.plan import Plan
from tasks.stages.exemplars.record import ExemplarRecord
from tasks.stages.facades.stage import (
    choose_facade_exemplars,
    exemplar_choice_walls,
    exemplar_library,
    facade_shop_flags,
)
from tasks.stages.ingest.planning import make_plan
from tasks.stages.shared.images import read_exemplar_picture, read_labels

DENSITIES = (16.0, 20.0, 32.0)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.variety", description=__doc__.partition("\n")[0])
    asked = parser.add_mutually_exclusive_group(required=True)
    asked.add_argument("--out", type=Path, help="folder of a run that has published")
    asked.add_argument("--block", type=Path, help="a block file")
    options = parser.parse_args()
    if options.block:
        block = read_block(options.block)
        plan = make_plan(block)
        texels = _texels(plan.scene.charts, plan.scene.placement)
        print(json.dumps({"benchmark": "variety", "exemplars": _chosen(block, plan), "texels": texels}, indent=1))
        return
    output = read_output(options.out)
    figures = {
        "benchmark": "variety",
        "exemplars": _exemplars(output),
        "fronts": walls.fronts(output),
        "twins": walls.twins(output),
        "texels": _texels(output.charts, output.placement) | {"store_bytes": _store_bytes(output)},
    }
    print(json.dumps(figures, indent=1))


def _exemplars(output: Output) -> dict[str, Any]:
    rows = output.items[output.items.photo == 0].reset_index()
    lines = {facade.id: _foot(output.charts, facade.chart) for facade in output.facades}
    return _counted(rows[rows.id.isin(list(lines))], lines)


def _chosen(block: Block, plan: Plan) -> dict[str, Any]:
    """The same of what is chosen for every facade, photos aside."""
    records: list[ExemplarRecord] = []
    seconds = []
    for picture in block.exemplars:
        begun = time.process_time()
        seen = read_exemplar_picture(picture)
        labels = read_labels(picture, seen.hidden.shape)
        made = prepare_exemplar(seen.rgb, seen.hidden, floor_height=block.storey, labels=labels)
        height, width = (side * made.metres_per_pixel for side in made.labels.shape)
        records.append(
            ExemplarRecord(
                unit=picture.stem,
                key="",
                status="done",
                width_m=width,
                height_m=height,
                floors=made.floors,
                hidden=float(made.occluded.mean()),
                shaded=made.shaded_share,
                shop_width=float((made.labels == FacadeClass.SHOP).any(axis=0).mean()),
                quality=made.quality.score,
                look=style_descriptor(made.image, made.labels, made.metres_per_pixel),
            )
        )
        seconds.append(time.process_time() - begun)
    shops = facade_shop_flags(plan, block.shops)
    chosen = choose_facade_exemplars(plan, records, exemplar_choice_walls(plan, block, shops), seed=block.seed)
    width = [record["shop_width"] for record in records]
    rows = pd.DataFrame(
        {
            "id": plan.facades.id,
            "building": plan.facades.building,
            "source": [chosen[facade][1] for facade in range(len(plan.facades))],
            "shops": [width[chosen[facade][0]] * (shops[facade] != 0) for facade in range(len(plan.facades))],
        }
    )[[one not in block.photos for one in plan.facades.id]]
    charts = plan.facades.chart.tolist()
    lines = {one: _foot(plan.scene.charts, chart) for one, chart in zip(plan.facades.id, charts, strict=True)}
    first = np.unique(plan.facades.house, return_index=True)[1].tolist()
    return _counted(rows, lines) | {
        "shares": _compare_shares(records, [chosen[facade][0] for facade in first]),
        "where_the_map_has_shops": int((shops > 0).sum()),
        "seconds": round(float(np.median(seconds)), 2),
    }


def _compare_shares(records: Sequence[ExemplarRecord], chosen: Sequence[int]) -> dict[str, Any]:
    """Compare shares among the exemplars with those on buildings, by the exemplar of each building."""
    family = exemplar_library(records).family
    with_shops = np.array([record["shop_width"] > 0 for record in records], float)
    asked, found = (
        np.bincount(which, minlength=family.max() + 1) / len(which) for which in (family, family[np.array(chosen)])
    )
    return {
        "buildings": len(chosen),
        "families": {"exemplars": asked.round(3).tolist(), "buildings": found.round(3).tolist()},
        "family_difference": round(float(0.5 * np.abs(found - asked).sum()), 3),
        "with_shops": {
            "exemplars": round(float(with_shops.mean()), 3),
            "buildings": round(float(with_shops[np.array(chosen)].mean()), 3),
        },
    }


def _counted(rows: pd.DataFrame, lines: Mapping[str, shapely.LineString]) -> dict[str, Any]:
    near = shapely.STRtree([lines[id] for id in rows.id])
    one, other = near.query(near.geometries, predicate="dwithin", distance=NEIGHBOURHOOD_M)
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


def _texels(charts: Charts, placement: ChartPlacements) -> dict[str, Any]:
    area, density = charts.size.prod(axis=1), placement.texels_per_metre
    held = placement.width.astype(np.int64) * placement.height
    return {
        "charts": len(charts),
        **{f"at_{step:g}": round(float(area.sum() * step**2) / 1e6, 1) for step in DENSITIES},
        "now": {
            f"{step:g}": {
                "share_of_area": round(float(area[density == step].sum() / area.sum()), 3),
                "millions": round(float(held[density == step].sum()) / 1e6, 1),
            }
            for step in np.unique(density).tolist()
        },
        "millions": round(float(held.sum()) / 1e6, 1),
    }


def _store_bytes(output: Output) -> float:
    """Of a texel."""
    chunks = sum(path.stat().st_size for path in (output.snapshot.out / "store" / "chunks").iterdir())
    return round(chunks / float((output.placement.width.astype(np.int64) * output.placement.height).sum()), 2)


def _foot(charts: Charts, chart: int) -> shapely.LineString:
    ends = charts.points_at_shares(np.array([chart]), np.array([[0.0, 1.0], [1.0, 1.0]]))[0, :, :2]
    return shapely.LineString(ends)


if __name__ == "__main__":
    main()
